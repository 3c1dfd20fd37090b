"""Write the job that *Submit* makes: a copy of the file, the farm's template and the panel's settings."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, system_errors
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.identity import FARM_COPY
from lfsr_core.pipeline.farms import FarmJob, Submission, write_job

from ..scene import folders
from ..scene import settings as scene_settings
from ..scene.array.scale import scale_of
from ..scene.displays import PROFILE_FILE
from . import show_image
from .copy import save_copy
from .recipes import animation_recipe

COPY_SUFFIX = f"{FARM_COPY}.blend"  # never the name of a file that somebody works on


def submit(scene: bpy.types.Scene, farm: str, folder: Path, parts: int) -> Submission:
    """Write the job of the timeline's range for ``farm``, "openjd" or "flamenco", with ``parts`` parts per frame.

    ``folder`` is created where it is missing; every machine of the farm must see it under the same path. LfsrError
    where the scene cannot be rendered or the folder cannot be written to.
    """
    scene_settings.resolve(scene).check_light_field("a farm's job")
    recipe = animation_recipe(scene)
    job = recipe.job
    if job.sampling.scales:
        with show_image.wait_cursor():
            job = job.with_scale(scale_of(scene, job))
    with system_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    copy = folder / f"{folders.file_stem()}{COPY_SUFFIX}"
    job = dataclasses.replace(job, output=str(recipe.folder.parent), scene=str(copy))
    finish = Finish(recipe.method, linear_exr=recipe.linear_exr, temporal_averaging=recipe.temporal_averaging)
    wanted = FarmJob(job, finish, recipe.frames, parts, _profile(scene, folder))
    with atomic_path(copy) as temporary:
        save_copy(temporary)
    return write_job(farm, folder, wanted)


def chosen_folder(directory: str) -> Path:
    """Folder for a job; LfsrError where none was chosen, or it is relative to a file that was never saved."""
    if not directory.strip():
        raise LfsrError("no folder is chosen for the farm's job: give one that every machine of the farm can see")
    return folders.absolute(directory, "the folder of the job")


def _profile(scene: bpy.types.Scene, folder: Path) -> str:
    """Copy the display's profile where it is a file and return the copy's path, else an empty one."""
    if scene.lfsr.display != PROFILE_FILE:
        return ""
    path = folders.absolute(scene.lfsr.profile_file, "the display profile")
    target = folder / path.name
    if path.resolve() != target.resolve():
        with atomic_path(target) as temporary:
            shutil.copyfile(path, temporary)
    return str(target)
