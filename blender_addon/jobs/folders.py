"""A scene's frame folders: where they are, whose they are, what they hold, and what a button requests in them.

Also how many seconds an image takes, from the last render of its scene or of some of its lenses, else of this machine.
"""

import contextlib
import dataclasses
import math
import os
import re
import shutil
import tempfile
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import check_name, is_forbidden, read_json, system_errors, write_json
from lfsr_core.frames.folder import FrameFolder, is_of, is_same
from lfsr_core.frames.frame import EIA_FILE, FRAME_FILE, PANEL_FILE, Finish, Frame, Request, samples_at, spread
from lfsr_core.optics.panel.subpixel_rays import rendered_size
from lfsr_core.pipeline.parts import has_parts
from lfsr_core.plan.options import Measured
from lfsr_core.reconstruct.methods import MethodName, seconds

from ..scene import settings as scene_settings
from ..scene.files import SECONDS_IN_PANEL, unreadable
from ..scene.settings import UNSAVED, absolute, file_stem
from ..scene.words import DIRECT
from . import runtime

PROBE_BYTES = 1 << 20
START = 4.0  # seconds until another Blender has opened a small scene, on two cores
TELLING_PATHS = 10**5  # least path samples of a render that tells how fast this machine is
SAME = 0.2  # relative change of this speed below which the preference stays
CONTINUE = "Render again to continue"


def scene_folder(scene: bpy.types.Scene) -> Path:
    """Folder of this scene's frames; each scene of each file has its own. LfsrError where it cannot exist."""
    output = (_unsaved(scene) if waits_for_saving(scene) else absolute(scene.lfsr.output or "//", "the output folder"))
    folder = output / _clean(file_stem()) / _clean(scene.name_full)
    check_name(folder)
    return folder


def try_output(scene: bpy.types.Scene) -> None:
    """LfsrError where this scene's folder cannot be made or written to, which is found out by writing."""
    folder = scene_folder(scene)
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        with system_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(bytes(PROBE_BYTES))
    finally:
        for path in missing:
            with contextlib.suppress(OSError):
                path.rmdir()


def frame_folder(scene: bpy.types.Scene, number: int | None = None) -> Path:
    """Frame folder of frame ``number``, by default the current one."""
    return scene_folder(scene) / f"{scene.frame_current if number is None else number:04d}"


def source_of(scene: bpy.types.Scene) -> str:
    """The open file as frames of ``scene`` name it: as seen from their folders, so that both can move together.

    A file that was never saved has a name that no other file and no later session has.
    """
    if not bpy.data.filepath:
        return f"{UNSAVED} {Path(bpy.app.tempdir).name} {scene.session_uid}"
    with contextlib.suppress(ValueError):  # on another drive
        return Path(os.path.relpath(bpy.data.filepath, frame_folder(scene))).as_posix()
    return bpy.data.filepath


def is_own(scene: bpy.types.Scene, folder: Path) -> bool:
    """False if the frame in ``folder`` is known to be of another file or scene."""
    return is_of(FrameFolder(folder).readable, source_of(scene), scene.name_full)


def is_unfinished(folder: Path) -> bool:
    """True if ``folder`` holds a render of which the second stage made no image."""
    return FrameFolder(folder).holds() and not any((folder / name).is_file() for name in (EIA_FILE, PANEL_FILE))


def finished_frame(scene: bpy.types.Scene, purpose: str) -> Path:
    """Frame folder of the current frame; LfsrError where it has no image of a light field of this scene.

    ``purpose``: for the error, as in "to preview".
    """
    folder = shown_frame(scene, purpose)
    if not (folder / EIA_FILE).is_file():
        raise LfsrError(f"the image in {folder} was made by {DIRECT} and has no views {purpose}: switch that off under "
                        "Quality, Advanced, and render the EIA again")
    return folder


def shown_frame(scene: bpy.types.Scene, purpose: str) -> Path:
    """Frame folder of the current frame; LfsrError where it has no image of this scene for the panel."""
    folder = frame_folder(scene)
    if not is_own(scene, folder):
        raise LfsrError(f"{foreign(folder)}: render the EIA first, or choose another output folder")
    if not any((folder / name).is_file() for name in (EIA_FILE, PANEL_FILE)):
        raise LfsrError(f"there is no image in {folder} {purpose}: render the EIA first")
    return folder


def _clean(name: str) -> str:
    """Name of a folder: letters of any language stay, which `bpy.path.clean_name` replaces."""
    cleaned = re.sub(r"[^\w.-]+", "_", name).rstrip(".") or "_"
    return f"_{cleaned}" if is_forbidden(cleaned) else cleaned


def waits_for_saving(scene: bpy.types.Scene) -> bool:
    """True if images go among Blender's temporary files, because they belong beside a file that was never saved.

    In background mode it is False: temporary files are removed at the end, so a script must state an output folder.
    """
    return not bpy.data.filepath and (scene.lfsr.output or "//").startswith("//") and not bpy.app.background


def keep_saved() -> None:
    """Move what was rendered before the file was first saved to its place beside the file, if that is free."""
    for scene in bpy.data.scenes:
        with contextlib.suppress(LfsrError, OSError):  # it stays where it is
            older, folder = _unsaved(scene) / UNSAVED / _clean(scene.name_full), scene_folder(scene)
            if not older.is_dir() or folder.exists():
                continue
            folder.mkdir(parents=True)
            for path in (path for path in older.iterdir() if not path.name.startswith(".")):  # those are at work
                frame = Path(shutil.move(path, folder)) / FRAME_FILE
                if frame.is_file():
                    write_json(frame, read_json(frame, "a frame") | {"source": source_of(scene)})
            for image in bpy.data.images:
                path = Path(bpy.path.abspath(image.filepath)).resolve()  # Blender makes it relative as it saves
                if path.is_relative_to(older.resolve()):
                    image.filepath = str(folder / path.relative_to(older.resolve()))
            state = bpy.context.window_manager.lfsr
            if Path(state.outcome_folder).is_relative_to(older):
                state.outcome_folder = str(folder / Path(state.outcome_folder).relative_to(older))


def _unsaved(scene: bpy.types.Scene) -> Path:
    return Path(bpy.app.tempdir, f"lfsr-unsaved-{scene.session_uid}")


def foreign(folder: Path) -> str:
    """Return a sentence that tells whose image ``folder`` holds."""
    frame = FrameFolder(folder).part
    file = frame.scene
    if frame.source:
        path = Path(os.path.normpath(folder / frame.source))
        is_unsaved = frame.source.startswith(f"{UNSAVED} ")
        file = "a file that was never saved" if is_unsaved else f"{path.name} in the folder {path.parent.name}"
    return (f"frame {folder.name} in the output folder is an image of another scene, "
            f"{frame.scene_name or folder.parent.name!r} of {file}")


def requested(scene: bpy.types.Scene, frame: int | None = None) -> tuple[Request, Finish]:
    """Request and finish of a frame, by default the current one; LfsrError where it cannot be rendered."""
    settings = scene_settings.resolve_for_render(scene)
    number = scene.frame_current if frame is None else frame
    # Unreadable files are allowed, because the artist was asked about them.
    return dataclasses.replace(settings.request, output=str(frame_folder(scene, number)), frame=number,
                               source=source_of(scene),
                               allow_missing=bool(unreadable(scene, number, SECONDS_IN_PANEL))), settings.finish


def timeline(scene: bpy.types.Scene) -> tuple[int, ...]:
    """Numbers of the frames of the timeline's range."""
    return tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))


def requested_animation(scene: bpy.types.Scene) -> tuple[Request, Finish, tuple[int, ...]]:
    """Request, finish and numbers of the timeline's frames; the output is the folder of their folders."""
    frames = timeline(scene)
    request, finish = requested(scene, frames[0])
    request = dataclasses.replace(request, output=str(Path(request.output).parent))
    return (request.sampled(frames=spread(frames) if request.sampling.scales else ()), finish, frames)


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
    state, times = bpy.context.window_manager.lfsr, frame.samples / request.samples_at(frame.scale)
    # Per requested path, because a noisy scene takes more rays. Of every image, because the scene changes.
    remember(scene_name, Measured(state.probe_fixed if state.probe_scene == scene_name else START,
                                  taken / paths * times, frame.scale))
    preferences = runtime.preferences_of_addon()
    if preferences is not None and abs(preferences.seconds_per_path * paths / taken - 1) > SAME:
        preferences.seconds_per_path = taken / paths
        bpy.context.preferences.is_dirty = True  # Blender saves them as it quits


def expected_seconds(scene: bpy.types.Scene) -> float | None:
    """Seconds that an image of ``scene`` will take with its present settings.

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
    seeds = report.finish.seeds_of(request.seed, (frame.frame, *report.neighbours))
    request = dataclasses.replace(request, seed=seeds[frame.frame])
    return (folder.image.is_file() and is_same(frame, request)
            and MethodName.parse(report.finish.method) == MethodName.parse(finish.method))


def kept(folder: Path) -> str:
    """What to do about an image of which only a part, or only the render, is there; "" where there is neither."""
    if is_unfinished(folder):
        return "The render is kept: finish it with another method"
    return CONTINUE if has_parts(FrameFolder(folder).parts) else ""


def views_file(folder: Path) -> Path:
    """File of a frame folder's decoded views, among this session's temporary files."""
    return runtime.temporary("views", folder).with_suffix(".npy")


def is_decoded(folder: Path) -> bool:
    """True if the decoded views are there and not older than the image."""
    views, image = views_file(folder), folder / EIA_FILE
    return views.is_file() and image.is_file() and views.stat().st_mtime >= image.stat().st_mtime
