"""The tasks behind the buttons: a frame, an animation, a reference, a preview."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import to_data
from lfsr_core.frames.folder import DERIVED_FILES
from lfsr_core.frames.frame import EIA_FILE, SUBPIXELS, frame_folder, read_rendered
from lfsr_core.frames.numbers import spread
from lfsr_core.frames.request import Request, Sampling
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.pipeline.staging import parts_folder, publish, staging_folder

from ..scene import folders
from ..scene import settings as scene_settings
from ..scene.proof import proof_of
from . import estimate, runtime
from .copy import file_copy
from .steps import PANEL_TASKS, SAVING, Steps, render_step, rendering_step, scale_step, second_stage_step

RENDER_FRACTION = 0.85  # of a frame's time
SCALE_FRACTION = 0.01  # of an animation's time
PROOF_FRACTION = 0.05  # of a task's time


@dataclasses.dataclass(frozen=True)
class Recipe:
    """Frames to make, from a scene's settings when the button was pressed."""

    folder: Path  # frame folder of the first frame
    job: Request  # render job of the first frame
    method: str
    linear_exr: bool  # also write the image before the view transform
    frames: tuple[int, ...]
    overwrite: bool  # make frames of an animation again that are complete
    temporal_averaging: int  # neighbouring frames on each side that are averaged where nothing has changed

    @property
    def is_direct(self) -> bool:
        """True if the panel's subpixels are rendered: there are no elemental images and no views."""
        return self.job.layout == SUBPIXELS

    @property
    def is_complete(self) -> bool:
        """True if the first frame's folder holds just this image already."""
        return folders.is_complete(self.folder, self.job, self.method)


def frame_recipe(scene: bpy.types.Scene, frames: tuple[int, ...] = ()) -> Recipe:
    """Recipe of ``frames``, by default the current one; LfsrError where they cannot be rendered."""
    settings, frames = scene_settings.resolve_for_render(scene), frames or (scene.frame_current,)
    folder = folders.frame_folder(scene, frames[0])
    # A second stage that cannot start should be an error before the render, not after it.
    runtime.second_stage_command(PANEL_TASKS)
    job = dataclasses.replace(settings.job(folder, frames[0]), source=folders.source_of(scene))
    return Recipe(folder, job, str(settings.method), settings.linear_exr, frames,
                  scene.lfsr.use_overwrite, settings.temporal_averaging)


def timeline(scene: bpy.types.Scene) -> tuple[int, ...]:
    """Numbers of the frames of the timeline's range."""
    return tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))


def animation_recipe(scene: bpy.types.Scene) -> Recipe:
    """Recipe of the frames of the timeline's range; LfsrError where they cannot be rendered."""
    recipe = frame_recipe(scene, frames := timeline(scene))
    scale_frames = spread(frames) if recipe.job.sampling.scales else ()
    return dataclasses.replace(recipe, job=recipe.job.sampled(frames=scale_frames))


def render_animation(recipe: Recipe) -> Steps:
    """Render and finish the frames that are missing; the result is the last one's folder and a sentence."""
    output = recipe.folder.parent
    yield SAVING
    with file_copy(output) as copy, staging_folder(runtime.temporary("animation", output)) as work:
        job = dataclasses.replace(recipe.job, scene=str(copy), output=str(output))
        if job.sampling.scales:  # before the frames, so that those of another scale are rendered again
            chosen = yield scale_step(job, work, SCALE_FRACTION)
            job = job.with_scale(ScaleChoice(chosen["scale"], chosen["reason"]))
        second = {"method": recipe.method, "linear_exr": recipe.linear_exr,
                  "temporal_averaging": recipe.temporal_averaging}
        step = rendering_step("Rendering", 0.98 - SCALE_FRACTION, work, "animation", job=to_data(job),
                              frames=recipe.frames, second=second, overwrite=recipe.overwrite)
        done = yield dataclasses.replace(step, resumes=True)
    print(done["table"])
    if done["failed"]:
        raise LfsrError(f"{done['sentence']}; {done['failed']}; press Render Animation again to make what is missing")
    last = frame_folder(output, recipe.frames[-1])
    if not recipe.is_direct and not is_decoded(last):
        yield from decode_views(last, 0.02)
    return last, done["sentence"]


def render_frame(recipe: Recipe, proof: Recipe | None = None, show: Callable[[Path], None] = lambda _: None) -> Steps:
    """Render and finish one frame; the result is its folder.

    A ``proof`` is made before it, and ``show`` called with its folder.
    """
    yield SAVING
    with file_copy(recipe.folder) as copy:
        if proof is not None:
            shutil.rmtree(proof.folder, ignore_errors=True)
            yield from _render_frame(proof, copy, PROOF_FRACTION, "Proof")
            show(proof.folder)
        yield from _render_frame(recipe, copy, 1 - PROOF_FRACTION if proof else 1.0)
    return recipe.folder


def proof_recipe(scene: bpy.types.Scene, recipe: Recipe) -> Recipe | None:
    """Recipe of the proof of a frame, among this session's temporary files; None where it needs none."""
    settings = proof_of(scene_settings.resolve(scene))
    if settings is None:
        return None
    folder = runtime.temporary("proof", recipe.folder) / recipe.folder.parent.name / "Proof"
    job = dataclasses.replace(settings.job(folder, recipe.frames[0]), source=recipe.job.source)
    return dataclasses.replace(recipe, folder=folder, job=job, linear_exr=False)


def _render_frame(recipe: Recipe, copy: Path, fraction: float, stage: str = "") -> Steps:
    """Render and finish one frame of a ``copy`` of the file, in a ``fraction`` of the task's time.

    ``stage``: what both steps are called, instead of their own names.
    """
    with staging_folder(recipe.folder) as folder:
        staged = folder / "frame"
        staged.mkdir()
        job = dataclasses.replace(recipe.job, scene=str(copy), output=str(staged),
                                  parts=str(parts_folder(recipe.folder)))
        second = stage or ("Denoising" if recipe.is_direct else "Upscaling")
        seconds = estimate.second_stage(job.display, job.sampling.scale, recipe.method, recipe.is_direct)
        yield render_step(job, folder, fraction * RENDER_FRACTION, stage or "Rendering",
                          estimate.expected(second, seconds))
        finish = second_stage_step(
            second, fraction * (1 - RENDER_FRACTION), folder, "upscale",
            folder=str(staged), method=recipe.method, linear_exr=recipe.linear_exr,
            views=None if recipe.is_direct else str(views_file(recipe.folder)))
        try:
            yield dataclasses.replace(finish, seconds=seconds)
        except LfsrError as error:
            if stage:
                raise  # a proof is quickly made again
            publish(staged, recipe.folder, DERIVED_FILES)
            raise LfsrError(f"{error}. The render is kept: finish it with another method") from None
        publish(staged, recipe.folder, DERIVED_FILES)


def finish_frame(folder: Path, method: str, linear_exr: bool) -> Steps:
    """Finish the rendered frame in ``folder``; the result is the folder."""
    views = None if read_rendered(folder).panel_rays else str(views_file(folder))
    with staging_folder(runtime.temporary("finish", folder)) as work:
        yield second_stage_step("Upscaling" if views else "Denoising", 1.0, work, "upscale", folder=str(folder),
                                method=method, linear_exr=linear_exr, views=views)
    return folder


def reference_recipe(scene: bpy.types.Scene) -> tuple[Recipe, Request]:
    """The finished frame to judge and the job of its reference; LfsrError where there is no such frame."""
    scene_settings.resolve(scene).check_light_field("a reference")
    recipe = frame_recipe(scene)
    folders.finished_frame(scene, "to compare")
    if not recipe.is_complete:
        raise LfsrError(f"the image in {recipe.folder} was made with other settings: render the EIA again first")
    return recipe, dataclasses.replace(
        recipe.job, sampling=Sampling(1, scene.lfsr.reference_samples), kind="reference", layers=(), clamp_indirect=0.0,
        output=str(recipe.folder.with_name(f"{recipe.folder.name}_reference")))


def render_reference(recipe: Recipe, job: Request, lenses: int) -> Steps:
    """Render the reference of ``lenses`` lenses (0: all) and compare; the result is the metrics."""
    folder = Path(job.output)
    yield SAVING
    with file_copy(folder) as copy, staging_folder(folder) as work:
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


def decode_views(folder: Path, fraction: float = 1.0) -> Steps:
    """Decode the finished frame in ``folder`` in a ``fraction`` of the task's time; the result is its views' file."""
    views = views_file(folder)
    with staging_folder(views) as work:
        yield second_stage_step("Decoding views", fraction, work, "decode", folder=str(folder), views=str(views))
    return views


def views_file(folder: Path) -> Path:
    """File of a frame folder's decoded views, among this session's temporary files."""
    return runtime.temporary("views", folder).with_suffix(".npy")


def is_decoded(folder: Path) -> bool:
    """True if the decoded views are there and not older than the image."""
    views, image = views_file(folder), folder / EIA_FILE
    return views.is_file() and image.is_file() and views.stat().st_mtime >= image.stat().st_mtime
