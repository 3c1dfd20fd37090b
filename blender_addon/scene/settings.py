"""Resolve a scene's settings, its file and its display into one record that panel, checks and render jobs read."""

import dataclasses
import functools
import math
import os
import re
import zlib
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import file_stamp
from lfsr_core.frames import frame as files
from lfsr_core.frames.frame import Finish, Request, Sampling, check_light, is_light_file, light_parts, scales_up_to
from lfsr_core.images.color import ColorSettings
from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display
from lfsr_core.reconstruct.methods import AS_RENDERED, DEFAULT_METHOD, MENU, MORE, SUBPIXEL_METHODS, MethodName

from .. import compat
from .array import rig
from .contents import GEOMETRY, find_subject, rendered, with_copied
from .light import FILE_LIGHT, NAMES
from .words import DIRECT

PROFILE_FILE, UNSAVED, WORKING_SPACE = "FILE", "untitled", "Linear Rec.709"
DEFAULT_DISPLAY = "first-look"  # a new file's: its images take seconds on two cores
SCALES, AUTO_SCALE = (1, 2, 3, 4, 5, 8), "AUTO"
QUALITY_SAMPLES = {"DRAFT": 4, "BALANCED": 16, "FINAL": 64}  # at the usual scale


def absolute(path: str, what: str) -> Path:
    """Absolute path of a Blender path; LfsrError if it is relative to a file that was never saved."""
    if path.startswith("//") and not bpy.data.filepath:
        raise LfsrError(f"{what} is {path!r}, beside the .blend file, but this file is not saved yet: "
                        "save it or choose another folder")
    return Path(bpy.path.abspath(path)).absolute()


def file_stem() -> str:
    """Name of the open file without its suffix."""
    return Path(bpy.data.filepath).stem or UNSAVED


@dataclasses.dataclass(frozen=True)
class Resolved:
    """Settings of a scene, with what its display and its device decide."""

    request: Request  # of the current frame, without a folder; for the scale Auto, at the largest of its scales
    finish: Finish
    rays: float | None  # per finished pixel, which decide the samples; None where these are fixed

    @property
    def display(self) -> DisplayProfile:
        """The display that is rendered for."""
        return self.request.display

    @property
    def sampling(self) -> Sampling:
        """Scale and samples, or what they follow from."""
        return self.request.sampling

    @property
    def subpixels(self) -> bool:
        """True if the panel's subpixels are rendered, without a light field."""
        return self.request.layout == files.SUBPIXELS

    @property
    def method(self) -> MethodName:
        """The method that finishes the image."""
        return MethodName.parse(self.finish.method)

    def check_light_field(self, what: str) -> None:
        """LfsrError if ``what``, as in "a plan", has no light field to work on."""
        if self.subpixels:
            raise LfsrError(f"{what} needs a light field, which {DIRECT} does not render: switch it off under Quality, "
                            "Advanced")


def resolve(scene: bpy.types.Scene) -> Resolved:
    """Resolve the settings; LfsrError where the display's profile cannot be read, or it does not have the scale."""
    settings, display, device, light = scene.lfsr, display_of(scene), device_of(scene), _light_of(scene)
    rays, scale, method = None if settings.samples else settings.rays, 1, MethodName.parse(settings.method)
    scales: tuple[int, ...] = ()
    if subpixels := settings.subpixels and display.is_woven:
        method = method if method.text == AS_RENDERED else MethodName.parse(SUBPIXEL_METHODS[0])
        finish = Finish(method.text)
    else:
        scales = method.scales_of(scales_up_to(display)) if settings.scale == AUTO_SCALE else ()
        if not method.needs_denoiser:  # where every view is rendered, nothing would remove the noise
            scales = tuple(scale for scale in scales if scale > 1) or scales
        scale = scales[0] if scales else int(settings.scale)
        finish = Finish(method.text, linear_exr=settings.linear_exr, temporal_averaging=settings.temporal_averaging)
    sampling = Sampling(scale, settings.samples or files.samples_at(display, scale, settings.rays), scales,
                        rays if scales else None)
    request = Request("", display, sampling=sampling, layout=files.SUBPIXELS if subpixels else compat.way_of(device),
                      scene_name=scene.name_full, seed=settings.seed, frame=scene.frame_current, device=device,
                      light=light if light_parts(light)[0] in files.LIGHTS or is_light_file(light) else files.AUTO)
    return Resolved(request, finish, rays)


def _light_of(scene: bpy.types.Scene) -> str:
    """Return the light of a scene's settings as a request has it; nothing is checked."""
    light, strength = scene.lfsr.light, scene.lfsr.light_strength
    if light == FILE_LIGHT:
        return bpy.path.abspath(scene.lfsr.light_file)
    return f"{NAMES[light]}:{strength:g}" if NAMES[light] in files.WORLD_IMAGES and strength != 1 else NAMES[light]


def check(scene: bpy.types.Scene) -> Resolved:
    """Resolve the settings; LfsrError where display, scale and method do not go together, or light is missing."""
    resolved, light = resolve(scene), _light_of(scene)
    if not light:
        raise LfsrError("no light file is chosen: give a .hdr or .exr file, or choose another light")
    check_light(light)
    if not resolved.subpixels:
        resolved.method.check_scale(resolved.sampling.scale)
    return resolved


def resolve_for_render(scene: bpy.types.Scene) -> Resolved:
    """Resolve the settings; LfsrError for whatever makes a render impossible before it starts."""
    compat.cycles_preferences()
    resolved = check(scene)
    find_subject(scene)
    color_settings(scene)
    if rig.placement(scene, resolved.display) is None:
        raise LfsrError(f"scene {scene.name!r} has no camera array: add one in the Light Field tab")
    return resolved


def color_settings(scene: bpy.types.Scene, world_visible: bool = False) -> ColorSettings:
    """Return the settings with which the second stage shows the scene's colours as Blender; LfsrError if it cannot."""
    view = scene.view_settings
    for name in ("exposure", "gamma"):
        if not math.isfinite(getattr(view, name)):
            raise LfsrError(f"the scene's view {name} is {getattr(view, name)}, but it must be a finite number: "
                            "set it in Render Properties, Color Management")
    if (space := compat.working_space()) != WORKING_SPACE:
        raise LfsrError(f"the file's working space is {space}, but renders must be in {WORKING_SPACE}: choose "
                        f"{WORKING_SPACE} in Render Properties, Color Management")
    if world_visible and any(item.is_shadow_catcher for item in bpy.data.objects):  # quick; instances are not
        # Objects whose instancer catches shadows do so, too. In 5.2 lights have the same switch with another meaning.
        catchers = {item for item in scene.objects if item.is_shadow_catcher} | {
            instance.object.original for instance in bpy.context.evaluated_depsgraph_get().object_instances
            if instance.is_instance and (instance.object.is_shadow_catcher or instance.parent.is_shadow_catcher)}
        if names := sorted(item.name for item in catchers & with_copied(rendered(scene)) if item.type in GEOMETRY):
            raise LfsrError(f"{names[0]!r} is a shadow catcher in front of a visible world, which would render too "
                            "dark: make the film transparent or switch Shadow Catcher off")
    config = os.environ.get("OCIO") or str(
        Path(bpy.utils.system_resource("DATAFILES"), "colormanagement", "config.ocio"))
    return ColorSettings(scene.display_settings.display_device, view.view_transform, view.look or "None",
                         view.exposure, view.gamma, config)


def renders_subpixels(scene: bpy.types.Scene) -> bool:
    """True if the panel's subpixels are rendered; False also where the display cannot be read."""
    return scene.lfsr.subpixels and is_woven(scene)


def device_of(scene: bpy.types.Scene) -> str:
    """What Cycles will render this scene on: "CPU" or a GPU type such as "OPTIX"."""
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None or scene.cycles.device == "CPU":
        return "CPU"
    chosen: str = addon.preferences.compute_device_type
    return "CPU" if chosen == "NONE" else chosen


def display_of(scene: bpy.types.Scene) -> DisplayProfile:
    """The scene's display profile; LfsrError where its file is missing or wrong."""
    settings = scene.lfsr
    if settings.display != PROFILE_FILE:
        return _read(settings.display)
    if not settings.profile_file:
        raise LfsrError("no display profile is chosen: give a .toml file or choose a built-in display")
    path = absolute(settings.profile_file, "the display profile")
    if path.suffix != ".toml":
        raise LfsrError(f"display profile {path.name} is not a .toml file: choose another")
    return _read(str(path), file_stamp(path))


def readable_display(scene: bpy.types.Scene) -> DisplayProfile | None:
    """The scene's display profile, None where it is missing or wrong: the panel says so."""
    try:
        return display_of(scene)
    except LfsrError:
        return None


@functools.lru_cache(maxsize=32)
def _read(name: str, _changed: str = "") -> DisplayProfile:
    """Read a display; panels ask on every redraw, and a file is read once per change."""
    return load_display(name)


def profile_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items of the built-in displays by title, then of a profile in a file.

    Each has a number of its own, so that new displays do not change saved scenes.
    """
    displays = [load_display(name) for name in builtin_names()]
    items = [(display.name, display.title or display.name, display.description.rstrip("."), "DESKTOP",
              zlib.crc32(display.name.encode()) & 0x7FFFFFFF) for display in displays]
    # Numbers in titles are sorted by their size: 5″ stands before 14″.
    items.sort(key=lambda item: [(float(part), "") if number % 2 else (-1.0, part) for number, part
                                 in enumerate(re.split(r"(\d+(?:\.\d+)?)", item[1].casefold()))])
    return [*items, (PROFILE_FILE, "From File…", "Display profile in a .toml file", "FILE", 0)]


def offered_scales(scene: bpy.types.Scene) -> list[str]:
    """Names of the scales that divide the views of the scene's display; only Auto where it cannot be read."""
    display = readable_display(scene)
    possible = {1, *display.scales()} if display else set()
    return [AUTO_SCALE, *(f"{scale}" for scale in SCALES if scale in possible)]


def qualities(scene: bpy.types.Scene) -> dict[str, tuple[float, int, str]]:
    """Rays per pixel, fixed samples (none) and method of each quality preset, on the scene's display."""
    display = readable_display(scene) or load_display(DEFAULT_DISPLAY)
    subpixels = scene.lfsr.subpixels and display.is_woven
    return {name: (float(samples) if subpixels else files.usual_rays(display, samples), 0, DEFAULT_METHOD)
            for name, samples in QUALITY_SAMPLES.items()}


def is_woven(scene: bpy.types.Scene) -> bool:
    """True if the display has a lens sheet; False also where it cannot be read."""
    display = readable_display(scene)
    return display is not None and display.is_woven


def has_quilts(scene: bpy.types.Scene) -> bool:
    """True if images for the display have views that Looking Glass Bridge can show."""
    display = readable_display(scene)
    return display is not None and display.lenticular is not None and not renders_subpixels(scene)


def live_scale(scene: bpy.types.Scene, display: DisplayProfile, is_eye: bool) -> int:
    """Scale of the live view, or of the eye's; a panel with a lens sheet shows its subpixels."""
    return 1 if display.is_woven and not is_eye else int(scene.lfsr.live_scale)


def live_samples(scene: bpy.types.Scene, is_eye: bool) -> int:
    """Samples per pixel after which the live view, or the eye's, stops; 0 for no limit."""
    lfsr = scene.lfsr
    if lfsr.live_samples or not lfsr.live_rays:
        return int(lfsr.live_samples)
    display = readable_display(scene)  # the live view says what is wrong with it
    return files.samples_at(display, live_scale(scene, display, is_eye), lfsr.live_rays) if display else 0


def title(method: str) -> str:
    """Title of a method in the menu; of one that is not in it, its name."""
    return (MENU | MORE).get(method, (method, ""))[0]


def length(scene: bpy.types.Scene, value: float) -> str:
    """A length in the scene's units, as Blender shows it."""
    units = scene.unit_settings
    if units.system == "NONE" or not math.isfinite(value):
        return f"{value:.3g}"
    text: str = bpy.utils.units.to_string(units.system, "LENGTH", value * units.scale_length, precision=3,
                                          split_unit=False, compatible_unit=False)
    return text
