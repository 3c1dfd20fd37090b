"""The tasks behind the buttons: a frame, an animation, a reference, a preview."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import EIA_FILE, SUBPIXELS, frame_folder
from lfsr_core.frames.job import Job
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.records import to_data
from lfsr_core.render.parts_folder import parts_folder
from lfsr_core.render.process import DERIVED_FILES
from lfsr_core.render.staging import publish

from ..array import rig
from ..settings import scene_settings
from . import runtime
from .steps import PANEL_TASKS, Steps, file_copy, render_step, rendering_step, second_stage_step, staging

RENDER_SHARE = 0.85


@dataclasses.dataclass(frozen=True)
class FrameRecipe:
    """One frame as its scene asked for when the button was pressed."""

    # Frame folder to fill.
    folder: Path
    # The render stage's job.
    job: Job
    # The second stage's method, by name.
    method: str
    # Also write the image before the view transform.
    linear_exr: bool = False

    @property
    def straight(self) -> bool:
        """True if the panel's subpixels are rendered: there are no elemental images and no views."""
        return self.job.layout == SUBPIXELS

    @property
    def complete(self) -> bool:
        """True if the folder holds just this image already."""
        return scene_settings.is_complete(self.folder, self.job, self.method)


def frame_recipe(scene: bpy.types.Scene, number: int | None = None) -> FrameRecipe:
    """Recipe of frame ``number``, by default the current one; LfsrError where it cannot be rendered."""
    scene_settings.check_renderable(scene)
    if rig.find(scene) is None:
        raise LfsrError(f"scene {scene.name!r} has no camera array: add one in the Light Field tab")
    folder = scene_settings.frame_folder(scene, number)
    job = scene_settings.render_job(scene, folder, number)
    rig.placement(scene, job.display)
    # A second stage that cannot start should be an error before the render, not after it.
    runtime.second_stage_command(PANEL_TASKS)
    method = scene_settings.method_of(scene)
    if job.scale == 1 and scene.lfsr.scale == scene_settings.AUTO_SCALE:
        method = method.without_upscaler()
    return FrameRecipe(folder, job, str(method), scene.lfsr.linear_exr and job.layout != SUBPIXELS)


@dataclasses.dataclass(frozen=True)
class AnimationRecipe:
    """The timeline's frames as their scene asked for when the button was pressed."""

    first: FrameRecipe
    frames: tuple[int, ...]
    overwrite: bool  # frames that are done are made again
    share_frames: int = 0  # neighbouring frames to each side that are averaged where they show the same

    @property
    def last_folder(self) -> Path:
        """Frame folder of the last frame."""
        return frame_folder(self.first.folder.parent, self.frames[-1])


def animation_recipe(scene: bpy.types.Scene) -> AnimationRecipe:
    """Recipe of the frames of the timeline's range; LfsrError where they cannot be rendered."""
    frames = tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    first = frame_recipe(scene, frames[0])
    return AnimationRecipe(first, frames, scene.lfsr.use_overwrite, 0 if first.straight else scene.lfsr.share_frames)


def render_animation(recipe: AnimationRecipe) -> Steps:
    """Render and finish the frames that are not done; the result is the last one's folder and a sentence."""
    first = recipe.first
    with file_copy() as copy:
        yield from _check_method(first.method, copy.parent)
        job = dataclasses.replace(first.job, scene=str(copy), output=str(first.folder.parent))
        second = {"method": first.method, "linear_exr": first.linear_exr, "share_frames": recipe.share_frames}
        done = yield rendering_step("Rendering animation", 0.98, copy.parent, "animation", job=to_data(job),
                                    frames=recipe.frames, second=second, overwrite=recipe.overwrite)
    print(done["table"])
    if done["failed"]:
        raise LfsrError(f"{done['sentence']}; {done['failed']}; press Render Animation again to make what is missing")
    if not first.straight and not is_decoded(recipe.last_folder):
        yield from decode_views(recipe.last_folder, 0.02)
    return recipe.last_folder, done["sentence"]


def render_frame(recipe: FrameRecipe) -> Steps:
    """Render and finish one frame; the result is its folder."""
    with file_copy() as copy:
        yield from _check_method(recipe.method, copy.parent)
        with staging(recipe.folder) as folder:
            staged = folder / "frame"
            staged.mkdir()
            job = dataclasses.replace(recipe.job, scene=str(copy), output=str(staged),
                                      parts=str(parts_folder(recipe.folder)))
            yield render_step(job, folder, RENDER_SHARE, "Rendering")
            yield second_stage_step(
                "Denoising" if recipe.straight else "Upscaling", 1 - RENDER_SHARE, folder, "upscale",
                folder=str(staged), method=recipe.method, linear_exr=recipe.linear_exr,
                views=None if recipe.straight else str(views_file(recipe.folder)))
            publish(staged, recipe.folder, DERIVED_FILES)
    return recipe.folder


def _check_method(method: str, work: Path) -> Steps:
    """A network that cannot run should be an error before the render, not after it."""
    if MethodName.parse(method).networks:
        yield second_stage_step("Checking method", 0.0, work, "check", method=method)


def reference_recipe(scene: bpy.types.Scene) -> tuple[FrameRecipe, Job]:
    """The finished frame to judge and the job of its reference; LfsrError where there is no such frame."""
    scene_settings.check_light_field(scene, "a reference")
    recipe = frame_recipe(scene)
    scene_settings.check_image(recipe.folder, "to compare")
    if not recipe.complete:
        raise LfsrError(f"the image in {recipe.folder} was made with other settings: render the EIA again first")
    return recipe, scene_settings.reference_job(scene, scene_settings.reference_folder(scene))


def render_reference(recipe: FrameRecipe, job: Job, lenses: int) -> Steps:
    """Render the reference of ``lenses`` lenses (0: all) and compare; the result is the metrics."""
    folder = Path(job.output)
    with file_copy() as copy, staging(folder) as work:
        staged = work / "frame"
        staged.mkdir()
        chosen = yield second_stage_step("Choosing lenses", 0.01, work, "choose", folder=str(recipe.folder),
                                         count=lenses, seed=job.seed)
        listed = chosen["lens_list"] and tuple((row, column) for row, column in chosen["lens_list"])
        job = dataclasses.replace(job, scene=str(copy), output=str(staged), lens_list=listed,
                                  parts=str(parts_folder(folder)))
        yield render_step(job, work, 0.94, "Rendering reference")
        publish(staged, folder)
        done = yield second_stage_step("Comparing", 0.05, work, "compare", folder=str(recipe.folder),
                                       reference=str(folder))
    return done["metrics"]


def decode_views(folder: Path, share: float = 1.0) -> Steps:
    """Decode the finished frame in ``folder`` for the preview; the result is the file of its views.

    ``share``: of the whole task's time.
    """
    views = views_file(folder)
    with staging(views) as work:
        yield second_stage_step("Decoding views", share, work, "decode", folder=str(folder), views=str(views))
    return views


def views_file(folder: Path) -> Path:
    """Where the decoded views of a frame folder lie: with this session's temporary files."""
    name = hashlib.md5(str(folder).encode(), usedforsecurity=False).hexdigest()[:16]
    return Path(bpy.app.tempdir, f"lfsr-views-{name}.npy")


def is_decoded(folder: Path) -> bool:
    """True if the decoded views are there and not older than the image."""
    views, image = views_file(folder), folder / EIA_FILE
    return views.is_file() and image.is_file() and views.stat().st_mtime >= image.stat().st_mtime
