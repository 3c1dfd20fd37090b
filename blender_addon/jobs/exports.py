"""The tasks behind *Open Viewer*, *Export* and *Show on Display*."""

from __future__ import annotations

import shutil
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path
from lfsr_core.exports.format_names import default_target
from lfsr_core.exports.frame_folders import frame_folders
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE
from lfsr_core.pipeline.staging import staging_folder

from . import runtime
from .steps import Step, Steps, second_stage_step

FILMS = ("sway", "wiggle")  # of one frame
QUILT_FILM = "quilt-film"  # of an animation
FILM_RATE = 30.0
ENCODE = "encode"  # the headless Blender's word for this job
FRAMES_FRACTION = 0.7  # of a film's time


def write_viewer(folder: Path) -> Steps:
    """Write the viewer of a finished frame; the result is its path."""
    with staging_folder(runtime.temporary("export", folder)) as work:
        done = yield second_stage_step("Writing viewer", 1.0, work, "view", folder=str(folder))
    return Path(done["path"])


def show(folder: Path, full_screen: bool) -> Steps:
    """Show a finished frame, on its display or ``full_screen``; the result is what ``frame_tasks.show`` returns."""
    with staging_folder(runtime.temporary("show", folder)) as work:
        done = yield _show(folder, full_screen, FILM_RATE, 1.0, work)
    return done


def show_animation(folder: Path, rate: float) -> Steps:
    """Show all finished frames in ``folder``, ``rate`` a second, on their display; the result as of ``show``."""
    frames = frame_folders(folder, (EIA_FILE, PANEL_FILE))
    with staging_folder(runtime.temporary("show", folder)) as work:
        found = yield second_stage_step("Showing", 0.05, work, "find_display", folder=str(frames[0]))
        path = folder
        if found["through_bridge"] and len(frames) > 1:
            path = yield from _film(folder, QUILT_FILM, default_target(folder, QUILT_FILM), work, rate, 0.9)
        done = yield _show(path, False, rate, 0.05, work)
    return done


def _show(path: Path, full_screen: bool, rate: float, fraction: float, work: Path) -> Step:
    return second_stage_step("Showing", fraction, work, "show", path=str(path), full_screen=full_screen, fps=rate)


def export(folder: Path, name: str, rate: float) -> Steps:
    """Export a finished frame in format ``name``; the result is the folder that it went to.

    A film of quilts shows all finished frames beside it, ``rate`` a second.
    """
    if name == QUILT_FILM:
        folder = folder.parent
        if len(frame_folders(folder)) < 2:
            raise LfsrError(f"there is one image only in {folder}, expected an animation: press Render Animation")
    target = default_target(folder, name)
    with staging_folder(runtime.temporary("export", folder)) as work:
        if name in (*FILMS, QUILT_FILM):
            yield from _film(folder, name, target, work, FILM_RATE if name in FILMS else rate)
        else:
            yield second_stage_step("Exporting", 1.0, work, "export", folder=str(folder), name=name,
                                    target=str(target))
    return target


def _film(folder: Path, name: str, target: Path, work: Path, rate: float, fraction: float = 1.0) -> Steps:
    """The second stage writes the frames and Blender encodes them: its Python has no encoder, but it has one.

    The result is the film; ``fraction`` of the task's time.
    """
    frames = work / "frames"
    done = yield second_stage_step("Exporting", fraction * FRAMES_FRACTION, work, "export", folder=str(folder),
                                   name=name, target=str(frames), type="png")
    film = work / f"{Path(done['first']).stem.rpartition('_')[0]}.mp4"
    command = [*runtime.render_command(ENCODE), str(frames), str(film), str(rate)]
    yield Step("Encoding", fraction * (1 - FRAMES_FRACTION), "The encoder", command)
    target.mkdir(parents=True, exist_ok=True)
    with atomic_path(target / film.name) as temporary:
        shutil.copy(film, temporary)
    return target / film.name
