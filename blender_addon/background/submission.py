"""What *Submit* writes: a copy of the file, the farm's template and the panel's settings, in one folder."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, system_errors
from lfsr_core.sequence.farms import FarmJob, Submission, write_job

from ..settings import scene_settings
from .recipes import animation_recipe
from .steps import save_copy

COPY_SUFFIX = ".farm.blend"  # never the name of a file that somebody works on


def submit(scene: bpy.types.Scene, farm: str, folder: Path, parts: int) -> Submission:
    """Write the job of the timeline's range into ``folder``.

    Parameters
    ----------
    scene : what to render, with its settings
    farm : "openjd" or "flamenco"
    folder : to be seen by every machine of the farm under the same path; made if it is not there
    parts : into how many parts each frame is split

    LfsrError where the scene cannot be rendered or the folder not written to.
    """
    scene_settings.check_light_field(scene, "a farm's job")
    recipe = animation_recipe(scene)
    with system_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    copy = folder / f"{Path(bpy.data.filepath).stem or 'untitled'}{COPY_SUFFIX}"
    job = dataclasses.replace(recipe.first.job, output=str(recipe.first.folder.parent), scene=str(copy))
    wanted = FarmJob(job, recipe.frames, recipe.first.method, recipe.first.linear_exr, parts, _profile(scene, folder),
                     recipe.share_frames)
    with atomic_path(copy) as temporary:
        temporary.unlink()  # of a file that is there already Blender would keep an older version
        save_copy(temporary)
    return write_job(farm, folder, wanted)


def chosen_folder(directory: str) -> Path:
    """The folder chosen for a job; LfsrError where none was, or it is relative to a file that was never saved."""
    if not directory.strip():
        raise LfsrError("no folder is chosen for the farm's job: give one that every machine of the farm sees")
    return scene_settings.absolute(directory, "the folder of the job")


def _profile(scene: bpy.types.Scene, folder: Path) -> str:
    """A copy of the display's profile where it is a file, else empty."""
    if scene.lfsr.display != scene_settings.PROFILE_FILE:
        return ""
    path = scene_settings.absolute(scene.lfsr.profile_file, "the display profile")
    target = folder / path.name
    if path.resolve() != target.resolve():
        with atomic_path(target) as temporary:
            shutil.copyfile(path, temporary)
    return str(target)
