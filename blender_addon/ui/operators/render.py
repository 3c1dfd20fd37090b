"""Buttons that render, compare and preview: read the settings, start a task, show its result.

Pressed in a window they return at once and a timer follows the task; called from
a script or in background mode they return when the result is there.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE

from ...background import recipes, session
from ...results import preview, show_image
from ...settings import folders
from .base import Prepared, Result, TaskOperator


class LFSR_OT_render_eia(TaskOperator, bpy.types.Operator):
    """Render the current frame as the display's elemental image array and open it in the Image Editor"""

    bl_idname = "lfsr.render_eia"
    bl_label = "Render EIA"

    def prepare(self, context: bpy.types.Context) -> Prepared:
        """One frame, then its image."""
        scene = context.scene
        recipe = recipes.frame_recipe(scene)
        return recipes.render_frame(recipe), _show_eia_of(scene.name)


class LFSR_OT_render_animation(TaskOperator, bpy.types.Operator):
    """Render the timeline's frame range; frames that are complete are kept"""

    bl_idname = "lfsr.render_animation"
    bl_label = "Render Animation"

    def prepare(self, context: bpy.types.Context) -> Prepared:
        """The frames that are missing, then the last one's image and what became of all."""
        scene = context.scene
        return recipes.render_animation(recipes.animation_recipe(scene)), _end_animation_of(scene.name)


class LFSR_OT_render_reference(TaskOperator, bpy.types.Operator):
    """Path trace every view of some lenses without reconstruction and measure how close the rendered image is"""

    bl_idname = "lfsr.render_reference"
    bl_label = "Render Reference + SSIM"

    def prepare(self, context: bpy.types.Context) -> Prepared:
        """The reference of the current frame, then the metrics in its report."""
        scene = context.scene
        recipe, job = recipes.reference_recipe(scene)
        return recipes.render_reference(recipe, job, scene.lfsr.reference_lenses), self._report_ssim

    @staticmethod
    def _report_ssim(metrics: dict[str, Any]) -> None:
        ssim = metrics.get("ssim_eia_fg", metrics.get("ssim_lens_fg"))
        print(f"Light Field: SSIM of the foreground {ssim:.4f}" if ssim is not None else "Light Field: no SSIM")


class LFSR_OT_preview_view(TaskOperator, bpy.types.Operator):
    """Show the view that the eye position sees in the Image Editor; its sliders then move the eye"""

    bl_idname = "lfsr.preview_view"
    bl_label = "Preview View"

    def prepare(self, context: bpy.types.Context) -> Prepared | None:
        """Decode the current frame's views unless that is done, then show one."""
        scene = context.scene
        folder = folders.frame_folder(scene)
        folders.check_image(folder, "to preview")
        if recipes.is_decoded(folder):
            _show_view(scene, recipes.views_file(folder))
            return None
        return recipes.decode_views(folder), functools.partial(_show_view_of, scene.name)


class LFSR_OT_cancel(bpy.types.Operator):
    """Stop the light-field render; finished frames stay, a long one can be taken up, the scene is as it was"""

    bl_idname = "lfsr.cancel"
    bl_label = "Cancel Light Field Render"

    def execute(self, _context: bpy.types.Context) -> Result:
        """Stop the worker and tidy up."""
        task = session.cancel()
        if task is None:
            self.report({"WARNING"}, "No light-field render is running")
            return {"CANCELLED"}
        self.report({"INFO"}, ". ".join(filter(None, ("Light-field render cancelled", task.kept))))
        return {"FINISHED"}


def _show_eia_of(scene_name: str) -> Callable[[Path], None]:
    def finish(folder: Path) -> None:
        scene = bpy.data.scenes.get(scene_name)
        if scene is not None:
            _load_views(scene, folder)
        panel = folder / PANEL_FILE
        show_image.open_file(panel if panel.is_file() else folder / EIA_FILE)
    return finish


def _load_views(scene: bpy.types.Scene, folder: Path) -> None:
    views = recipes.views_file(folder)
    if not (folder / EIA_FILE).is_file():
        preview.unload(scene)  # those of another render must not seem to be this one's
    elif views.is_file():
        preview.load(scene, views)


def _end_animation_of(scene_name: str) -> Callable[[tuple[Path, str]], None]:
    show = _show_eia_of(scene_name)

    def finish(result: tuple[Path, str]) -> None:
        folder, sentence = result
        show(folder)
        session.tell(sentence, "INFO")
    return finish


def _show_view_of(scene_name: str, views: Path) -> None:
    scene = bpy.data.scenes.get(scene_name)
    if scene is not None:
        _show_view(scene, views)


def _show_view(scene: bpy.types.Scene, views: Path) -> None:
    preview.load(scene, views)
    image = preview.show(scene, (scene.lfsr.eye_right, scene.lfsr.eye_up))
    show_image.in_editor(image)


CLASSES = (LFSR_OT_render_eia, LFSR_OT_render_animation, LFSR_OT_render_reference, LFSR_OT_preview_view,
           LFSR_OT_cancel)
