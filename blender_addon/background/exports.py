"""The tasks behind *Open Viewer* and *Export*."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import bpy

from lfsr_core.exports.format_names import default_target
from lfsr_core.files import atomic_path

from . import runtime
from .steps import Step, Steps, second_stage_step, staging
from .worker import Worker

FILM = "sway"
ENCODE = "encode"  # what the headless Blender is asked for
FRAMES_SHARE = 0.7


def write_viewer(folder: Path) -> Steps:
    """Write the viewer of a finished frame; the result is its path."""
    with staging(_work(folder)) as work:
        done = yield second_stage_step("Writing viewer", 1.0, work, "view", folder=str(folder))
    return Path(done["path"])


def export(folder: Path, name: str) -> Steps:
    """Export a finished frame in format ``name``; the result is the folder that it went to."""
    target = default_target(folder, name)
    with staging(_work(folder)) as work:
        if name == FILM:
            yield from _film(folder, target, work)
        else:
            yield second_stage_step("Exporting", 1.0, work, "export", folder=str(folder), name=name,
                                    target=str(target))
    return target


def _film(folder: Path, target: Path, work: Path) -> Steps:
    """Frames from the second stage, the film from Blender: its Python has no encoder, but Blender itself has."""
    frames = work / "frames"
    done = yield second_stage_step("Exporting", FRAMES_SHARE, work, "export", folder=str(folder), name=FILM,
                                   target=str(frames), type="png")
    name = Path(done["first"]).stem.rpartition("_")[0]
    film = work / f"{name}.mp4"
    command = [*runtime.render_command(ENCODE), str(frames), str(film)]
    yield Step("Encoding", 1 - FRAMES_SHARE, lambda: Worker("The encoder", command, runtime.environment()))
    target.mkdir(parents=True, exist_ok=True)
    with atomic_path(target / film.name) as temporary:
        shutil.copy(film, temporary)


def _work(folder: Path) -> Path:
    """Name of a folder to work in, among this session's temporary files."""
    name = hashlib.md5(str(folder).encode(), usedforsecurity=False).hexdigest()[:16]
    return Path(bpy.app.tempdir, f"lfsr-share-{name}")
