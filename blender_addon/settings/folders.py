"""Folders of a scene's images, and what they hold already."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.files import check_name
from lfsr_core.frames.averaging import seed_in_turn
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, SUBPIXELS, read_rendered
from lfsr_core.frames.identity import is_same
from lfsr_core.frames.job import Job
from lfsr_core.frames.report import read_report
from lfsr_core.reconstruct.method_name import MethodName

from .methods import DIRECT


def absolute(path: str, what: str) -> Path:
    """Absolute path of a Blender path; LfsrError if it is relative to a file that was never saved."""
    if path.startswith("//") and not bpy.data.filepath:
        raise LfsrError(f"{what} is {path!r}, beside the .blend file, but this file is not saved yet: "
                        "save it or choose another folder")
    return Path(bpy.path.abspath(path))


def scene_folder(scene: bpy.types.Scene) -> Path:
    """Folder of this scene's frames; each scene of a file has its own. LfsrError where it cannot exist."""
    folder = absolute(scene.lfsr.output or "//", "the output folder") / bpy.path.clean_name(scene.name)
    check_name(folder)
    return folder


def frame_folder(scene: bpy.types.Scene, number: int | None = None) -> Path:
    """Frame folder of frame ``number``, by default the current one."""
    return scene_folder(scene) / f"{scene.frame_current if number is None else number:04d}"


def is_complete(folder: Path, job: Job, method: str) -> bool:
    """True if ``folder`` holds the finished image of just this job and method, temporally averaged or not."""
    if not (folder / (PANEL_FILE if job.layout == SUBPIXELS else EIA_FILE)).is_file():
        return False
    try:
        frame, report = read_rendered(folder), read_report(folder)
    except LfsrError:
        return False  # an incomplete or older folder is rendered again
    # In an animation with temporal averaging neighbouring frames have seeds of their own.
    job = dataclasses.replace(job, seed=seed_in_turn(job.seed, frame.frame, report.temporal_averaging))
    return report.method == MethodName.parse(method).at_scale(frame.scale).text and is_same(frame, job)


def finished_frame(scene: bpy.types.Scene, purpose: str) -> Path:
    """Frame folder of the current frame; LfsrError where it has no image of a light field.

    ``purpose``: for the error, as in "to preview".
    """
    folder = frame_folder(scene)
    if (folder / EIA_FILE).is_file():
        return folder
    if (folder / PANEL_FILE).is_file():
        raise LfsrError(f"the image in {folder} was made by {DIRECT} and has no views {purpose}: switch that off under "
                        "Display and render the EIA again")
    raise LfsrError(f"there is no image in {folder} {purpose}: render the EIA first")
