"""What a button asks for, from a scene's settings of now: the request and the finish of its frames, and their seconds.

How long an image takes follows from a render of its scene or of a few of its lenses, else from this machine's last.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.folder import FrameFolder, is_same
from lfsr_core.frames.frame import EIA_FILE, Frame
from lfsr_core.frames.request import Finish, Request, samples_at, spread
from lfsr_core.optics.panel.subpixel_rays import rendered_size
from lfsr_core.pipeline.parts import has_parts
from lfsr_core.plan.options import Measured
from lfsr_core.reconstruct.methods import MethodName, seconds

from ..scene import folders
from ..scene import settings as scene_settings
from ..scene.files import SECONDS_IN_PANEL, unreadable
from ..scene.settings import Resolved
from . import runtime

START = 4.0  # seconds until another Blender has opened a small scene, on two cores
TELLING_PATHS = 10**5  # of a render that tells how fast this machine is
SAME = 0.2  # relative change of that below which the preference stays
CONTINUE = "Render again to continue"


def asked(scene: bpy.types.Scene, frame: int | None = None) -> tuple[Request, Finish]:
    """Request and finish of a frame, by default the current one; LfsrError where it cannot be rendered."""
    settings = scene_settings.resolve_for_render(scene)
    number = scene.frame_current if frame is None else frame
    # The artist was asked about what cannot be read.
    return dataclasses.replace(settings.request, output=str(folders.frame_folder(scene, number)), frame=number,
                               source=folders.source_of(scene),
                               allow_missing=bool(unreadable(scene, number, SECONDS_IN_PANEL))), settings.finish


def timeline(scene: bpy.types.Scene) -> tuple[int, ...]:
    """Numbers of the frames of the timeline's range."""
    return tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))


def asked_animation(scene: bpy.types.Scene) -> tuple[Request, Finish, tuple[int, ...]]:
    """Request, finish and numbers of the timeline's frames; the output is the folder of their folders."""
    frames = timeline(scene)
    request, finish = asked(scene, frames[0])
    request = dataclasses.replace(request, output=str(Path(request.output).parent))
    return (request.sampled(frames=spread(frames) if request.sampling.scales else ()),
            finish, frames)


def paths_of(settings: Resolved) -> float:
    """Return the paths of a finished image, about."""
    pixels = math.prod(settings.display.eia_pixels)
    if settings.rays is not None:
        return pixels * settings.rays
    return pixels / settings.display.finished_pixels(settings.sampling.scale) * settings.sampling.samples


def remember(scene_name: str, measured: Measured) -> None:
    """Store what was measured for the panel, and for other settings of the same scene."""
    state = bpy.context.window_manager.lfsr
    state.probe_scene = scene_name
    state.probe_fixed, state.probe_per_path, state.probe_scale = measured.fixed, measured.per_path, measured.scale


def learn(scene_name: str, frame: Frame, request: Request) -> None:
    """Store what the render of ``request`` has told of its scene, and how fast this machine is."""
    paths, taken = math.prod(frame.rays.size) * frame.samples, frame.seconds["render"]
    if taken <= 0 or paths < TELLING_PATHS or frame.subpixels:
        return
    if bpy.context.window_manager.lfsr.probe_scene != scene_name:
        times = frame.samples / request.samples_at(frame.scale)  # the rays that were asked for: the scene may be noisy
        remember(scene_name, Measured(START, taken / paths * times, frame.scale))
    preferences = runtime.preferences_of_addon()
    if preferences is not None and abs(preferences.seconds_per_path * paths / taken - 1) > SAME:
        preferences.seconds_per_path = taken / paths
        bpy.context.preferences.is_dirty = True  # Blender saves them as it quits


def expected_seconds(scene: bpy.types.Scene) -> float | None:
    """Seconds that an image of ``scene`` will take with its settings of now.

    None where nothing was measured, neither of the scene nor on this machine.
    """
    state = bpy.context.window_manager.lfsr
    is_measured = state.probe_scene == scene.name_full
    per_path = state.probe_per_path if is_measured else getattr(runtime.preferences_of_addon(), "seconds_per_path", 0.0)
    if not per_path:
        return None
    try:
        settings = scene_settings.resolve(scene)
        display, sampling = settings.display, settings.sampling
        scale = state.probe_scale if sampling.scales and is_measured else sampling.scale
        samples = sampling.samples if settings.rays is None else samples_at(display, scale, settings.rays)
    except LfsrError:
        return None  # the panel says what is wrong
    size = rendered_size(display) if settings.subpixels else display.eia_pixels
    paths = math.prod(size) / display.finished_pixels(scale) * samples
    finish = seconds(display, scale, settings.finish.method, settings.request.layout)
    return float((state.probe_fixed if is_measured else START) + per_path * paths + finish)


def is_made(request: Request, finish: Finish) -> bool:
    """True if the folder of ``request`` holds its image, made by this method, temporally averaged or not."""
    folder = FrameFolder(request.output)
    try:
        frame, report = folder.rendered, folder.report
    except LfsrError:
        return False
    # In an animation with temporal averaging neighbouring frames have seeds of their own.
    request = dataclasses.replace(request, seed=report.finish.seed_of(request.seed, frame.frame))
    return (folder.image.is_file() and is_same(frame, request)
            and MethodName.parse(report.finish.method) == MethodName.parse(finish.method))


def kept(folder: Path) -> str:
    """What to do about an image of which only a part, or only the render, is there; "" where there is neither."""
    if folders.is_unfinished(folder):
        return "The render is kept: finish it with another method"
    return CONTINUE if has_parts(FrameFolder(folder).parts) else ""


def views_file(folder: Path) -> Path:
    """File of a frame folder's decoded views, among this session's temporary files."""
    return runtime.temporary("views", folder).with_suffix(".npy")


def is_decoded(folder: Path) -> bool:
    """True if the decoded views are there and not older than the image."""
    views, image = views_file(folder), folder / EIA_FILE
    return views.is_file() and image.is_file() and views.stat().st_mtime >= image.stat().st_mtime
