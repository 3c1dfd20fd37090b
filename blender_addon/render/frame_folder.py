"""Render a request into its frame folder: place the array, render, write ``frame.json``."""

import dataclasses
import math
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, silent
from lfsr_core.base.records import to_data
from lfsr_core.base.system import file_digest, file_stamp
from lfsr_core.frames import frame as files
from lfsr_core.frames.folder import PLACES, digest, request_facts
from lfsr_core.frames.frame import Frame, Request, more_rays, write_frame
from lfsr_core.images.color import ViewTransform
from lfsr_core.images.image_files import Layers, clean, read_layers
from lfsr_core.optics.rays import pixel_rows
from lfsr_core.optics.world_view import WorldImage
from lfsr_core.pipeline.parts import ImageParts, Part, remove_others
from lfsr_core.reconstruct.upscaler import finished_layout
from lfsr_core.version import __version__

from .. import compat
from ..compat import overridden
from ..scene.array import edit, placement, rig
from ..scene.array.rig import Placement
from ..scene.contents import curves, find_subject, has_background_meshes, rendered
from ..scene.files import check_files, image_files
from ..scene.light import DEFAULT_LIGHT, LEAST_ALBEDO, has_light, is_certain, is_dim, lit
from ..scene.settings import color_settings
from . import cycles, world
from .cycles import RenderSettings
from .output import one_of, render_to, unfinished
from .view_by_view import render_views

# Added to a reference half's seed, so that no half has the random numbers of a candidate image.
HALF_SEED = 1 << 20
# Fields of a request that the scene or this machine may settle. The scene's path is free: the panel renders a copy.
SETTLED = ("scene", "device", "light", "sampling")
SOURCES = ("compat.py", "render/**/*.*", "scene/**/*.*")  # of the add-on, which decide pixels
# Pixels across, and samples per pixel, of the measurement of light and of the first view.
LIGHT_WIDTH, LIGHT_SAMPLES, FIRST_WIDTH, FIRST_SAMPLES = 64, 32, 160, 24
KEY, LIGHTEST, MOST_STOPS = 0.18, 0.7, 3  # log-average and brightest radiances that added light aims at
OPEN = 0.2  # least part of rays from what is seen that meets the sky, for a world image to light it
MOST_SECONDS = 120.0  # of an image with more rays than were asked for
Say = Callable[[Notice], object]


@dataclasses.dataclass(frozen=True)
class Opened:
    """How the scene was opened."""

    seconds: float = 0.0  # it took
    content: str = ""  # stamp of its file; empty if it is not known
    light: str = files.AUTO  # in which it is rendered, AUTO where that is not settled
    notes: tuple[Notice, ...] = ()  # what the user was told of it
    # New data for all its requests, None if each lights it: Cycles keeps what it makes of a world that stays.
    kept: list[bpy.types.ID] | None = None


def render_job(scene: bpy.types.Scene, request: Request, opened: Opened | None = None, tell: Tell = silent) -> Path:
    """Render ``request`` into its frame folder, and return that.

    The scene is unchanged afterwards, also after an error. ``opened``: how the scene was opened; without its file's
    stamp no parts of a long render are cached. An exception that ``tell`` raises cancels.
    """
    opened = opened or Opened()
    request = dataclasses.replace(request, device=compat.best_device(request.device),
                                  light=opened.light if request.light == files.AUTO else request.light)
    notes = list(opened.notes)

    def say(notice: Notice) -> None:
        if notice not in notes:  # files are checked when the scene is opened, and again at its frame
            notes.append(notice)
            tell(notice)

    with prepared(scene, request, say, opened.kept is not None) as frame:
        if request.first_view is not None:
            tell(Progress("first"))
            noise, per_ray = _write_first_view(scene, frame, request.first_view)
            usual = per_ray * math.prod(frame.rays.size) * frame.samples
            tell(Notice("first-view", {"path": request.first_view}))
            if (wanted := more_rays(request, noise)) > 1:
                times = max(times for times in files.TIMES_RAYS if times <= max(1, min(wanted, MOST_SECONDS / usual)))
                frame = dataclasses.replace(frame, samples=frame.samples * times)
                say(Notice("noisy", {"times": times}) if times == wanted else
                    Notice("noisy-long", {"times": wanted, "seconds": wanted * usual, "taken": times}))
        inputs = None
        if request.parts and opened.content:
            resolved = to_data(dataclasses.replace(frame, seconds={}, gpus=()))
            resolved |= {"scene": scene.name, "file": frame.scene, "scripts": bpy.app.autoexec_fail,
                         "light": request.light}
            paths = {*map(Path, bpy.utils.blend_paths(absolute=True, packed=False, local=False)), *image_files()}
            inputs = inputs_before_opening(request, opened.content) | {
                "samples or scale": digest([frame.scale, frame.samples]), "device, light or camera": digest(resolved),
                "images or linked files": digest([[str(path), file_stamp(path)] for path in sorted(paths)])}
            if other := remove_others(Path(request.parts), inputs):
                tell(Notice("parts-removed", {"input": other}))
        seconds = {"open": opened.seconds}
        if frame.world_apart:
            seconds["world"], path = 0.0, Path(request.output, files.WORLD_FILE)
            if request.world is None:
                settings = RenderSettings(world.SAMPLES, frame.seed, device=request.device)
                seconds["world"] = world.render_world(scene, WorldImage.of(finished_layout(frame)), frame.matrix_world,
                                                      settings, path)
            else:
                with unfinished(path) as temporary:
                    shutil.copyfile(request.world, temporary)
        rows = None if frame.rows is None else Part(*pixel_rows(frame.rows, frame.rays.views[1]))
        shot = cycles.Shot(frame.subpixels or frame.rays, frame.matrix_world, frame.layout, rows)
        images, seconds["render"] = _images(scene, request, frame), seconds.get("world", 0.0)
        with world.white_to_camera(scene, opened.kept) if frame.world_apart else nullcontext():
            for number, (name, settings) in enumerate(images):
                follow = one_of(lambda fraction, message: tell(Progress("render", fraction, message)), number,
                                len(images))
                path = Path(request.output, name)
                parts = ImageParts(Path(request.parts or ""), path.stem, inputs,
                                   another_follows=number + 1 < len(images)) if inputs else None
                seconds["render"] += (
                    render_views(scene, shot, settings, path, follow) if frame.layout == files.VIEW_BY_VIEW
                    else cycles.render_encoded(scene, shot, settings, path, follow, parts))
    seconds = {name: round(value, 3) for name, value in seconds.items()}
    write_frame(request.output, dataclasses.replace(frame, content=opened.content, seconds=seconds, notes=tuple(notes)))
    return Path(request.output)


@contextmanager
def prepared(scene: bpy.types.Scene, request: Request, say: Say = silent, is_lit: bool = False) -> Iterator[Frame]:
    """Set ``scene`` to the request's frame, light it unless it is, index objects inside the block; yield the Frame."""
    # Not at the request's frame: all frames of an animation have the same light.
    request = dataclasses.replace(request, light=settled_light(scene, request, say))
    with placement.same_frame(scene):
        if request.frame is not None:
            scene.frame_set(request.frame)
        check_files(scene, None, request.allow_missing, say)
        if request.sampling.scales and request.kind != "reference":
            request = request.with_scale(placement.scale_of(scene, request))
        subject = find_subject(scene, request.subject)
        with _resting(scene), cycles.pass_indices(subject), nullcontext() if is_lit else lit(scene, request.light):
            with placement.as_rendered():
                frame = _frame(scene, request, subject)
                part, placed = rig.part_of_spacing(frame.array, request.display), (frame.array, frame.matrix_world)
                if part < 0.999 and rig.find(scene) is None:
                    say(Notice("walls-near", {"part": part}))
                if notice := placement.unseen_notice(scene, request.display, placed, subject):
                    say(notice)
            if frame.world_visible and request.kind == "render" and frame.scale > 1:
                if reason := world.reason_against(scene):
                    say(Notice("world-inside", {"reason": reason}))
                frame = dataclasses.replace(frame, world_apart=not reason)
            yield frame


def settled_light(scene: bpy.types.Scene, request: Request, say: Say) -> str:
    """Return the light of ``scene``: the one asked for, or for AUTO the one that the scene needs now.

    A .blend keeps its own light if it has any, with a warning where that is too little; ``say`` tells of any other.
    The median over the subject decides, so that a small bright surface does not count as light.
    """
    if request.light != files.AUTO:
        return request.light
    has_own, is_blend = has_light(scene), Path(request.scene).suffix.lower() in ("", ".blend")
    if has_own and (is_certain(scene) or not is_dim(*light_seen(scene, request), is_composed=is_blend)):
        return files.OWN
    if has_own and is_blend:
        say(Notice("light-weak"))
        return files.OWN
    light = added_light(scene, request)
    say(Notice("light-replaced", {"reason": "dark" if has_own else "none", "light": light}))
    return light


def added_light(scene: bpy.types.Scene, request: Request) -> str:
    """Return a light for what the array sees: even light where hardly any sky reaches it, as in a room, else an image.

    Its strength takes the log-average of the radiances half the way to KEY, in stops, unless bright parts would glare
    (Reinhard et al., Photographic Tone Reproduction for Digital Images, 2002, equations 1 and 2).
    """
    placed: Placement | None = None
    hits = list[placement.Seen | None]()
    with placement.as_rendered(), suppress(LfsrError):
        placed = placement.place_array(scene, request.display, find_subject(scene, request.subject))
        hits = placement.through(placement.Rays(scene), placed, *edit.FEWER)
    with placement.as_rendered(by="visible_shadow"):  # walls that cameras do not see keep light out
        free = np.isinf(edit.around(placement.Rays(scene), filter(None, hits)))
    if free.sum() < OPEN * len(free):
        return files.EVEN
    with lit(scene, DEFAULT_LIGHT):
        color = np.maximum(light_seen(scene, request, placed)[1], 1e-4)
    stops = round(float(np.log2(KEY / np.exp(np.log(color).mean()))) / 2) if color.size else 0
    most = math.floor(np.log2(LIGHTEST / np.percentile(color, 95))) if color.size else 0
    stops = max(-1, min(stops, MOST_STOPS, max(0, most)))
    return f"{DEFAULT_LIGHT}:{2.0**stops:g}" if stops else DEFAULT_LIGHT


@placement.as_rendered()
def light_seen(scene: bpy.types.Scene, request: Request, placed: Placement | None = None) -> tuple[Array, Array]:
    """Measure with a tiny render the light of what the middle of a ``placed`` array, else of the scene's, sees.

    The CPU renders it: a GPU may first have to load for long, and the same scene gets the same light everywhere.
    Returns radiances (n,) at the scene's exposure: of white surfaces in the subject's place, and of the subject itself;
    empty where it is not in sight, without Cycles, and with a fluid: Blender 5.0 ends where one is not baked.
    """
    has_fluid = any(modifier.type == "FLUID" for item in rendered(scene) for modifier in item.modifiers)
    with suppress(LfsrError):
        if has_fluid or not hasattr(scene, "cycles"):
            return np.empty(0), np.empty(0)
        subject = find_subject(scene, request.subject)
        placed = placed or placement.place_array(scene, request.display, subject)
        settings = RenderSettings(LIGHT_SAMPLES, layers=("albedo", "index"), device="CPU")
        # In the last slot of Blender's own result, so that the artist's stays.
        slots = result.render_slots if (result := bpy.data.images.get("Render Result")) is not None else ()
        with (_resting(scene), cycles.pass_indices(subject),
              overridden(slots, {"active_index": len(slots) - 1}) if slots else nullcontext()):
            layers = _seen_from_middle(scene, placed, settings, LIGHT_WIDTH)
        seen = (layers["color"][..., 3] > 0.5) & (layers["index"][..., 0] == cycles.FOREGROUND)
        color, albedo = layers["color"][seen][:, :3].max(-1), layers["albedo"][seen].max(-1)
        color *= 2.0**scene.view_settings.exposure
        return color / np.maximum(albedo, LEAST_ALBEDO), color
    return np.empty(0), np.empty(0)


def _seen_from_middle(scene: bpy.types.Scene, placed: Placement, settings: RenderSettings, width: int) -> Layers:
    """Render what an eye in front of the middle of a ``placed`` array sees, ``width`` pixels across."""
    array, matrix_world = placed
    size = width, max(round(width * array.half_height / array.half_width), cycles.LEAST_PIXELS)
    # In Blender's own temporary folder, which is removed even if Blender crashes.
    with tempfile.TemporaryDirectory(prefix="lfsr-middle-", dir=bpy.app.tempdir or None) as name:
        path, world = Path(name, "middle.exr"), scene.world
        # A small map, which is made at once, says where the world is bright; 5.0 also maps volumes, for seconds.
        with (overridden(world.cycles, {"sampling_method": "MANUAL", "sample_map_resolution": 128}) if world is not None
              else nullcontext(), cycles.temporary_camera(scene, matrix_world, array.distance) as camera,
              cycles.cycles_settings(scene, settings, size),
              overridden(scene.cycles, compat.known(scene.cycles, volume_biased=True))):
            lens = camera.data
            lens.sensor_fit, lens.lens = "HORIZONTAL", lens.sensor_width / 2 * array.distance / array.half_width
            lens.clip_start, lens.clip_end = array.clip or (lens.clip_start, lens.clip_end)
            if world is not None:
                world.update_tag()  # Blender does not: a later render would have the small map
            render_to(scene, path)
        if world is not None:
            world.update_tag()
        return clean(read_layers(path))[0]


def _write_first_view(scene: bpy.types.Scene, frame: Frame, path: str) -> tuple[float, float]:
    """Write what an eye in the middle sees, as decoded views, uint8 (1, 1, sy, sx, 3): few pixels, so that it is quick.

    Returns the noise, which is the root mean square difference of two halves of its rays in display values from 0 to 1,
    and the seconds of a ray, from the second half, because Cycles prepares the scene before the first.
    """
    settings = RenderSettings(FIRST_SAMPLES // 2, frame.seed, device=frame.device, world_visible=frame.world_visible)
    halves = []
    for seed in (frame.seed, frame.seed ^ 1):
        started = time.perf_counter()
        layers = _seen_from_middle(scene, (frame.array, frame.matrix_world), dataclasses.replace(settings, seed=seed),
                                   min(FIRST_WIDTH, frame.display.lenses[0]))
        color = layers["color"]
        behind = layers["environment"] if frame.world_visible else (1 - color[..., 3:]) * frame.display.background
        halves.append(np.maximum(color[..., :3] + behind, 0).astype(np.float32))
        seconds = time.perf_counter() - started
    transform = ViewTransform(frame.color)
    with unfinished(path) as temporary, temporary.open("wb") as file:
        np.save(file, transform.to_uint8((halves[0] + halves[1]) / 2)[None, None])
    first, second = (transform.to_uint8(half).astype(np.float32) / 255 for half in halves)
    return float(np.sqrt(np.square(first - second).mean())), seconds / (math.prod(color.shape[:2]) * settings.samples)


def inputs_before_opening(request: Request, content: str) -> dict[str, str]:
    """Return a digest of each kind of input that is known without the scene, by a name for messages.

    Cached parts are used by a render with the same inputs only. ``content``: stamp of the scene's file.
    """
    addon = Path(__file__).resolve().parents[1]
    sources = [path for name in SOURCES for path in sorted(addon.glob(name)) if path.suffix in (".py", ".osl")]
    sampling = request.sampling
    chosen = {} if sampling.scales else {"samples or scale": digest([sampling.scale, sampling.samples])}
    return {"settings": digest(request_facts(request, (*PLACES, *SETTLED))), **chosen, "scene file": digest(content),
            "Blender": digest([bpy.app.version_string, str(bpy.app.build_hash)]),
            "version of LFSR": digest([__version__, *map(file_digest, sources)])}


def _frame(scene: bpy.types.Scene, request: Request, subject: set[bpy.types.Object]) -> Frame:
    """The frame that is asked for; LfsrError if the array cannot be placed or colours cannot be reproduced."""
    array, matrix_world = placement.place_array(scene, request.display, subject)
    # The second stage gets guides and positions, except at scale 1, where they would take as much memory again.
    guided = request.kind == "render" and request.sampling.scale > 1 and request.layout != files.SUBPIXELS
    layers = tuple(dict.fromkeys((*request.layers, *((*files.GUIDES, files.POSITION) if guided else ()))))
    if "index" not in layers and has_background_meshes(scene, subject):
        layers = (*layers, "index")
    if request.world_visible and scene.world is None:
        raise LfsrError(f"scene {scene.name!r} has no world to show behind the subject: add a world, or render "
                        "without one")
    if (world_visible := request.world_visible) is None:
        world_visible = (request.light in (files.OWN, files.EVEN) and scene.world is not None
                         and not scene.render.film_transparent)
    # The lens card renders where the OSL camera cannot.
    layout = compat.way_of(request.device) if request.layout == "one-pass" else request.layout
    return Frame(
        display=request.display, scale=1 if request.kind == "reference" else request.sampling.scale,
        scale_reason=request.sampling.reason, array=array, matrix_world=matrix_world,
        samples=request.sampling.samples, seed=request.seed, frame=scene.frame_current,
        convention=request.convention, view_aperture=request.view_aperture, lens_list=request.lens_list,
        rows=request.rows, layout=layout, layers=layers, world_visible=world_visible,
        color=color_settings(scene, world_visible), scene=os.path.basename(request.scene or bpy.data.filepath),
        scene_name=request.scene_name or scene.name_full, source=request.source, subject=request.subject or "",
        camera=request.camera or "", light=request.light, blender=bpy.app.version_string, device=request.device,
        gpus=compat.gpu_addresses(request.device))


def _images(scene: bpy.types.Scene, request: Request, frame: Frame) -> list[tuple[str, RenderSettings]]:
    """File and settings of every image to render: one, or a reference's two halves."""
    see_through = scene.render.film_transparent and scene.cycles.film_transparent_glass and not frame.world_visible
    settings = RenderSettings(frame.samples, request.seed, frame.layers, request.device, request.clamp_indirect,
                              frame.world_visible, see_through)
    if request.kind != "reference":
        return [(files.LOW_RES_FILE, settings)]
    # Unclamped unless the request clamps: clamping would bias a reference.
    settings = dataclasses.replace(settings, clamp_indirect=request.clamp_indirect or 0.0,
                                   half="position" not in frame.layers)
    return [(name, dataclasses.replace(settings, samples=(request.sampling.samples + 1 - half) // 2,
                                       seed=(request.seed + HALF_SEED * (half + 1)) % 2**31))
            for half, name in enumerate(files.REFERENCE_FILES)]


@contextmanager
def _resting(scene: bpy.types.Scene) -> Iterator[None]:
    """Mute what animates the settings of a render inside the block; ``scene`` must be at the frame to render.

    Blender evaluates animation again when a render starts. This mutes camera markers, all keyframes and drivers of the
    scene itself, which keeps its values of this frame, and those of the pass index of objects.
    """
    indices = (curve for item in bpy.data.objects for curve in curves(item) if curve.data_path == "pass_index")
    camera = scene.camera
    with ExitStack() as stack:
        stack.callback(setattr, scene, "camera", camera)
        for marker in scene.timeline_markers:
            stack.enter_context(overridden(marker, {"camera": None}))
        scene.camera = camera  # Blender has taken that of a marker that was still there
        for curve in [*curves(scene), *indices]:
            stack.enter_context(overridden(curve, {"mute": True}))
        yield
