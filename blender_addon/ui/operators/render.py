"""Buttons that render, compare and preview: read the settings, start a task, show its result."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE

from ...jobs import denoiser, preview, probe, recipes, session, show_image
from ...scene import folders
from ...scene import settings as scene_settings
from ...scene.methods import title
from ...scene.subject import find_subject
from . import check
from .base import Prepared, Question, Result, TaskOperator, add_missing_array

PROOF = "The image is a proof with fewer lenses and views. The full one follows; cancel if the proof looks wrong"


class LFSR_OT_render_eia(TaskOperator, bpy.types.Operator):
    """Render the current frame as the display's elemental image array and open it in the Image Editor"""

    bl_idname = "lfsr.render_eia"
    bl_label = "Render EIA"

    def questions(self, context: bpy.types.Context) -> list[Question]:
        """Ask before another scene's image is overwritten, where the method cannot run, and on what is left out."""
        return _asked(context.scene, (context.scene.frame_current,))

    wants_proof = False

    def start(self, context: bpy.types.Context) -> Result:
        """Start it with a proof, where the first image takes long."""
        self.wants_proof = True
        return super().start(context)

    def prepare(self, context: bpy.types.Context) -> Prepared:
        """Render one frame, then show its image. A scene without a camera array gets one."""
        scene = context.scene
        add_missing_array(scene)
        recipe = recipes.frame_recipe(scene)
        proof = recipes.proof_recipe(scene, recipe) if self.wants_proof and _is_first(scene, recipe) else None
        return recipes.render_frame(recipe, proof, _show_proof_of(scene, recipe)), show_image_of(scene)


class LFSR_OT_render_animation(TaskOperator, bpy.types.Operator):
    """Render the timeline's frame range; complete frames are not rendered again"""

    bl_idname = "lfsr.render_animation"
    bl_label = "Render Animation"

    def questions(self, context: bpy.types.Context) -> list[Question]:
        """Ask before another scene's frames are overwritten, where the method cannot run, and on what is left out."""
        return _asked(context.scene, recipes.timeline(context.scene))

    def prepare(self, context: bpy.types.Context) -> Prepared:
        """Render the frames that are missing, then show the last image and a summary."""
        add_missing_array(context.scene)
        steps = recipes.render_animation(recipes.animation_recipe(context.scene))
        return steps, functools.partial(_end_animation, context.scene.name_full)


class LFSR_OT_render_reference(TaskOperator, bpy.types.Operator):
    """Path trace every view of some lenses without reconstruction, and measure how close the rendered image is"""

    bl_idname = "lfsr.render_reference"
    bl_label = "Render Reference + SSIM"

    def prepare(self, context: bpy.types.Context) -> Prepared:
        """Render the reference of the current frame, then write the metrics into its report."""
        recipe, job = recipes.reference_recipe(context.scene)
        return recipes.render_reference(recipe, job, context.scene.lfsr.reference_lenses), _print_ssim


class LFSR_OT_preview_view(TaskOperator, bpy.types.Operator):
    """Show the view from the eye's position in the Image Editor; the sliders then move the eye"""

    bl_idname = "lfsr.preview_view"
    bl_label = "Preview View"

    def prepare(self, context: bpy.types.Context) -> Prepared | None:
        """Decode the current frame's views unless they are there, then show one."""
        scene = context.scene
        folder = folders.finished_frame(scene, "to preview")
        if recipes.is_decoded(folder):
            _show_view(scene.name_full, recipes.views_file(folder))
            return None
        return recipes.decode_views(folder), functools.partial(_show_view, scene.name_full)


class LFSR_OT_cancel(bpy.types.Operator):
    """Stop the light-field render; finished frames stay, and a long frame can be continued"""

    bl_idname = "lfsr.cancel"
    bl_label = "Cancel Light Field Render"

    def execute(self, _context: bpy.types.Context) -> Result:
        """Stop the worker and tidy up."""
        task = session.cancel()
        if task is None:
            self.report({"WARNING"}, "No light-field render is running")
            return {"CANCELLED"}
        session.say(task.cancelled)
        return {"FINISHED"}


def show_image_of(scene: bpy.types.Scene) -> Callable[[Path], None]:
    """Return what shows the image in a frame folder of ``scene``."""
    return functools.partial(_show_image, scene.name_full)


def _asked(scene: bpy.types.Scene, frames: Sequence[int]) -> list[Question]:
    find_subject(scene)  # where nothing would be rendered, nothing else matters
    return [*_denoising(scene), *_overwriting(scene, frames), *check.questions(scene, len(frames))]


def _denoising(scene: bpy.types.Scene) -> list[Question]:
    settings = scene_settings.resolve(scene)
    lacking = denoiser.lacking(settings)
    if lacking and denoiser.is_replaced(scene):
        _use_replacement(scene, settings)
        return []
    name = title(denoiser.replacement(settings).text)
    return [Question(lacking, f"Use {name}", f"choose the method {name}, or get it. {denoiser.where_to_get()}",
                     denoiser.where_to_get(), functools.partial(_use_replacement, scene, settings))
            ] if lacking else []


def _use_replacement(scene: bpy.types.Scene, settings: scene_settings.Resolved) -> None:
    if not scene.lfsr.is_property_set("method"):
        denoiser.remember_answer()
    denoiser.use_replacement(scene, settings)
    bpy.ops.ed.undo_push(message="Set Method")


def _is_first(scene: bpy.types.Scene, recipe: recipes.Recipe) -> bool:
    """True if nothing shows what the image will be, and it is not known to be there soon."""
    is_seen = (recipe.folder / EIA_FILE).is_file() or (
        bpy.context.window_manager.lfsr.proof_shown == _proof_name(recipe))
    return not is_seen and (probe.expected_seconds(scene) or math.inf) > check.LONG


def _proof_name(recipe: recipes.Recipe) -> str:
    return f"{recipe.folder.parent} {recipe.job.display.name}"


def _show_proof_of(scene: bpy.types.Scene, recipe: recipes.Recipe) -> Callable[[Path], None]:
    name = scene.name_full

    def show(folder: Path) -> None:
        if session.is_of_open_file():
            bpy.context.window_manager.lfsr.proof_shown = _proof_name(recipe)
            _show_image(name, folder)
            session.say(PROOF)
    return show


def _overwriting(scene: bpy.types.Scene, frames: Sequence[int]) -> list[Question]:
    taken = "" if scene.lfsr.use_overwrite else folders.first_foreign(scene, frames)
    return [Question(taken, "Overwrite", "turn on Overwrite, or choose another output folder")] if taken else []


def _show_image(scene_name: str, folder: Path) -> None:
    """Show the finished image in ``folder``, and preview its views where the scene is still open."""
    scene, views, panel = _scene(scene_name), recipes.views_file(folder), folder / PANEL_FILE
    if scene is not None and not (folder / EIA_FILE).is_file():
        preview.unload(scene)  # the views of an earlier render do not belong to this image
    elif scene is not None and views.is_file():
        preview.load(scene, views)
    show_image.open_file(panel if panel.is_file() else folder / EIA_FILE)
    bpy.context.window_manager.lfsr.outcome_folder = str(folder)


def _scene(name: str) -> bpy.types.Scene | None:
    """The scene of a full name in the open file."""
    return next((scene for scene in bpy.data.scenes if scene.name_full == name), None)


def _end_animation(scene_name: str, result: tuple[Path, str]) -> None:
    folder, sentence = result
    _show_image(scene_name, folder)
    session.say(sentence)


def _print_ssim(metrics: dict[str, Any]) -> None:
    ssim = metrics.get("ssim_eia_fg", metrics.get("ssim_lens_fg"))
    session.say(f"SSIM of the foreground {ssim:.4f}" if ssim is not None else "No SSIM: no lens shows any foreground")


def _show_view(scene_name: str, views: Path) -> None:
    scene = _scene(scene_name)
    if scene is not None:
        preview.load(scene, views)
        show_image.in_editor(preview.show(scene, (scene.lfsr.eye_right, scene.lfsr.eye_up)))


CLASSES = (LFSR_OT_render_eia, LFSR_OT_render_animation, LFSR_OT_render_reference, LFSR_OT_preview_view,
           LFSR_OT_cancel)
