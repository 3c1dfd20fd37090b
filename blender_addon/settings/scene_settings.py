"""What a scene's settings mean: its display, its jobs, its folders."""

from __future__ import annotations

import dataclasses
import functools
import math
import zlib
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.files import check_name
from lfsr_core.frames.averaging import seed_in_turn
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, SUBPIXELS, read_rendered
from lfsr_core.frames.identity import is_same, on_any_device
from lfsr_core.frames.job import Job
from lfsr_core.frames.report import read_report
from lfsr_core.optics.depth_scale import ScaleChoice, choose_scale, scales_up_to
from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, PANEL_METHODS, MethodName, default_method

from ..array import placement, rig
from ..render import devices
from ..render.color import color_settings
from ..scene.subject import find_subject
from .methods import check_scale

PROFILE_FILE = "FILE"
FIRST_PROFILES = ("bupt-32in-8k", "dense-8k", "fhd", "mini", "small")
SCALES = (1, 2, 3, 4, 5, 8)
AUTO_SCALE = "AUTO"
QUALITY_SAMPLES = {"DRAFT": 4, "BALANCED": 16, "FINAL": 64}
GPU_TYPES = ("NONE", "CPU")
STRAIGHT = "Straight to Subpixels"


def profile_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items of the built-in displays and of a profile in a file."""
    items = []
    for name in builtin_names():
        display = load_display(name)
        # A saved scene keeps the number: those of the first profiles are their places.
        number = FIRST_PROFILES.index(name) + 1 if name in FIRST_PROFILES else zlib.crc32(name.encode()) & 0x7FFFFFFF
        items.append((name, name, display.description, "DESKTOP", number))
    return [*items, (PROFILE_FILE, "From File…", "Display profile in a .toml file", "FILE", 0)]


def display_of(scene: bpy.types.Scene) -> DisplayProfile:
    """The scene's display profile; LfsrError where its file is gone or wrong."""
    settings = scene.lfsr
    if settings.display != PROFILE_FILE:
        return load_display(settings.display)
    if not settings.profile_file:
        raise LfsrError("no display profile is chosen: give a .toml file or choose a built-in display")
    path = absolute(settings.profile_file, "the display profile")
    if path.suffix != ".toml":
        raise LfsrError(f"display profile {path.name} is no .toml file: choose another")
    try:
        changed = path.stat().st_mtime_ns
    except OSError as error:
        raise LfsrError(f"display profile {path} cannot be read ({error.strerror}): "
                        "choose another file or a built-in display") from None
    return _read_profile(str(path), changed)


@functools.lru_cache(maxsize=8)
def _read_profile(path: str, _changed: int) -> DisplayProfile:
    """Panels ask on every redraw; the file is read once per change."""
    return load_display(path)


def qualities(scene: bpy.types.Scene) -> dict[str, tuple[int, str]]:
    """Samples and method of each quality preset, on the scene's display."""
    try:
        best = default_method(display_of(scene).parallax)
    except LfsrError:
        best = DEFAULT_METHOD  # the panel says what is wrong with the display
    return {name: (samples, best) for name, samples in QUALITY_SAMPLES.items()}


def absolute(path: str, what: str) -> Path:
    """Absolute path of a Blender path; LfsrError if it is relative to a file that was never saved."""
    if path.startswith("//") and not bpy.data.filepath:
        raise LfsrError(f"{what} is {path!r}, beside the .blend file, but this file is not saved yet: "
                        "save it or choose another folder")
    return Path(bpy.path.abspath(path))


def device_of(scene: bpy.types.Scene) -> str:
    """What Cycles will render this scene on: "CPU" or a GPU type such as "OPTIX"."""
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None or scene.cycles.device == "CPU":
        return "CPU"
    chosen = addon.preferences.compute_device_type
    return "CPU" if chosen in GPU_TYPES else chosen


def has_sheet(scene: bpy.types.Scene) -> bool:
    """True if the scene's display has a lens sheet; False also where its profile cannot be read."""
    try:
        return display_of(scene).is_woven
    except LfsrError:
        return False  # the panel says what is wrong with the display


def is_straight(scene: bpy.types.Scene) -> bool:
    """True if the panel's subpixels are to be rendered, without a light field."""
    return scene.lfsr.straight and has_sheet(scene)


def why_not_straight(scene: bpy.types.Scene) -> str | None:
    """Why the subpixels of a panel cannot be rendered on the scene's device, None if they can."""
    if not devices.has_osl():
        return f"{STRAIGHT} needs a Blender with Open Shading Language"
    device = device_of(scene)
    if devices.has_osl_camera(device):
        return None
    return f"{STRAIGHT} renders on {' or '.join(devices.WITH_OSL_CAMERA)}, not on {device}"


def check_light_field(scene: bpy.types.Scene, what: str) -> None:
    """LfsrError if ``what``, as in "a plan", has no light field to work on."""
    if is_straight(scene):
        raise LfsrError(f"{what} needs a light field, which {STRAIGHT} goes without: switch it off under Display")


def layout_of(scene: bpy.types.Scene) -> str:
    """Which rays are sent, and how on the scene's device."""
    return SUBPIXELS if is_straight(scene) else devices.way_of(device_of(scene))


def method_of(scene: bpy.types.Scene) -> MethodName:
    """The second stage's method: the one that is set, unless only one makes sense."""
    return MethodName.parse(PANEL_METHODS[0] if is_straight(scene) else scene.lfsr.method)


def scene_folder(scene: bpy.types.Scene) -> Path:
    """Where this scene's frames go, one folder per scene so that two scenes do not overwrite each other.

    LfsrError where there can be no such folder.
    """
    folder = absolute(scene.lfsr.output or "//", "the output folder") / bpy.path.clean_name(scene.name)
    check_name(folder)
    return folder


def frame_folder(scene: bpy.types.Scene, number: int | None = None) -> Path:
    """Frame folder of frame ``number``, by default the current one."""
    return scene_folder(scene) / f"{scene.frame_current if number is None else number:04d}"


def reference_folder(scene: bpy.types.Scene, number: int | None = None) -> Path:
    """Where the reference of a frame goes, beside its frame folder."""
    folder = frame_folder(scene, number)
    return folder.with_name(f"{folder.name}_reference")


def scale_of(scene: bpy.types.Scene) -> int:
    """The scale that is set, or the largest that may be chosen; LfsrError where the display cannot be read."""
    if is_straight(scene):
        return 1
    if scene.lfsr.scale != AUTO_SCALE:
        return int(scene.lfsr.scale)
    return scales_up_to(display_of(scene))[0]


def chosen_scale(scene: bpy.types.Scene) -> ScaleChoice:
    """The scale that is set, or what the subject's depth allows now, and why."""
    display, method = display_of(scene), method_of(scene)
    scales = [scale for scale in scales_up_to(display) if scale == 1 or method.works_at(scale)]
    placed = rig.placement(scene, display)
    if scene.lfsr.scale != AUTO_SCALE or placed is None or is_straight(scene):
        return ScaleChoice(scale_of(scene), scene.lfsr.samples)
    depths = placement.seen_depths(scene, placed, find_subject(scene))
    return choose_scale(display, placed[0], depths, scales, scene.lfsr.samples)


def render_job(scene: bpy.types.Scene, output: Path, number: int | None = None) -> Job:
    """The job of one frame; LfsrError where the settings cannot be rendered."""
    settings, scale = scene.lfsr, chosen_scale(scene)
    return Job(output=str(output), display=display_of(scene), scale=scale.scale, scale_reason=scale.reason,
               spp=scale.samples, scene_name=scene.name, layers=method_of(scene).layers,
               layout=layout_of(scene), seed=settings.seed,
               frame=scene.frame_current if number is None else number, device=device_of(scene))


def reference_job(scene: bpy.types.Scene, output: Path, number: int | None = None) -> Job:
    """The job of the high-resolution reference of the same frame."""
    settings = scene.lfsr
    return Job(output=str(output), display=display_of(scene), kind="reference", scale=1, scene_name=scene.name,
               spp=settings.reference_samples, layout=layout_of(scene), seed=settings.seed,
               frame=scene.frame_current if number is None else number, device=device_of(scene), clamp_indirect=0.0)


def is_complete(folder: Path, job: Job, method: str) -> bool:
    """True if ``folder`` holds the finished image of just this job and method."""
    if not (folder / (PANEL_FILE if job.layout == SUBPIXELS else EIA_FILE)).is_file():
        return False
    try:
        frame, report = read_rendered(folder), read_report(folder)
    except LfsrError:
        return False  # an incomplete or older folder is rendered again
    # In an animation with temporal averaging neighbouring frames have seeds of their own.
    job = dataclasses.replace(job, seed=seed_in_turn(job.seed, frame.frame, report.temporal_averaging))
    return report.method == method and is_same(frame, on_any_device(job))


def check_image(folder: Path, purpose: str) -> None:
    """LfsrError unless ``folder`` holds the finished image of a light field; ``purpose``: as in "to preview"."""
    if (folder / EIA_FILE).is_file():
        return
    if (folder / PANEL_FILE).is_file():
        raise LfsrError(f"the image in {folder} was rendered straight to subpixels and has no views {purpose}: switch "
                        f"{STRAIGHT} off under Display and render the EIA again")
    raise LfsrError(f"there is no image in {folder} {purpose}: render the EIA first")


def check_renderable(scene: bpy.types.Scene) -> None:
    """LfsrError for whatever makes a render impossible before it starts."""
    if bpy.context.preferences.addons.get("cycles") is None:
        raise LfsrError("Cycles is switched off in Blender's preferences: switch the Cycles Render Engine add-on on")
    check_method(scene)
    find_subject(scene)
    color_settings(scene)


def check_method(scene: bpy.types.Scene) -> None:
    """LfsrError where the display's views cannot be divided by the scale, or the method cannot make them.

    Or where the device cannot send the rays of subpixels.
    """
    if is_straight(scene):
        _check_straight(scene)
        return
    display, scale = display_of(scene), scale_of(scene)
    display.low_views(scale)
    if not MethodName.parse(scene.lfsr.method).works_with(display.parallax):
        raise LfsrError(f"display {display.name!r} has views in one direction, and this method's network needs two: "
                        "choose a method without Refine or a network, as Denoise + Bilinear + Recover")
    check_scale(scene.lfsr.method, scale)


def _check_straight(scene: bpy.types.Scene) -> None:
    reason = why_not_straight(scene)
    if reason:
        raise LfsrError(f"{reason}: choose one, or switch it off under Display")


def length(scene: bpy.types.Scene, value: float) -> str:
    """A length in the scene's units, as Blender shows it."""
    units = scene.unit_settings
    if units.system == "NONE" or not math.isfinite(value):
        return f"{value:.3g}"
    return bpy.utils.units.to_string(units.system, "LENGTH", value * units.scale_length, precision=3,
                                     split_unit=False, compatible_unit=False)
