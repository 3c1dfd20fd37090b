"""Panels of the sidebar's tab "Light Field": drawing only."""

from __future__ import annotations

import contextlib

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import duration

from ..check import last
from ..jobs import preview, session, timing
from ..scene import folders
from ..scene import settings as scene_settings
from ..scene.array import cached, rig
from ..scene.light import FILE_LIGHT
from . import array_view, display_panel, summary
from .drawing import LightFieldPanel, columns, facts, row_if, sentence
from .operators.array import FIT_ITEMS
from .problem_rows import draw_problems

UNSAVED_NOTE = "Images are lost when Blender quits, unless you save the file: they then move beside it"


class LFSR_PT_array(LightFieldPanel, bpy.types.Panel):
    """The camera array in the scene"""

    bl_label = "Camera Array"
    bl_order = 1

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, distance and spacing."""
        scene, layout = context.scene, self.layout
        array = cached.find(scene)
        if array is None:
            layout.operator("lfsr.array_add", text="Add", icon="OUTLINER_OB_CAMERA")
            _draw_fits(layout, "Add at")
            return
        row = layout.row(align=True)
        row.operator("lfsr.look_through", icon="VIEW_CAMERA", depress=array_view.is_looking(context.space_data, scene))
        row.operator("lfsr.array_remove", text="", icon="TRASH")
        _draw_fits(layout, "Fit to")
        column = columns(layout).column()
        column.enabled = rig.why_not_editable(array) is None
        row = column.row(align=True)
        row.prop(context.scene.lfsr, "distance", text="Distance")
        row.operator("lfsr.select_plane", text="", icon="RESTRICT_SELECT_OFF")
        column.prop(context.scene.lfsr, "spacing", text="Spacing", slider=True)
        column.prop(context.scene.lfsr, "show_frustum")
        try:
            facts(layout, summary.depth_facts(scene))
        except LfsrError as error:
            sentence(layout, str(error), "ERROR", context)


class LFSR_PT_check(LightFieldPanel, bpy.types.Panel):
    """Problems that the render will have"""

    bl_label = "Scene Check"
    bl_order = 2

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the button and the rows of the last check."""
        layout, state = self.layout, context.window_manager.lfsr
        layout.operator("lfsr.check_scene", text="Check Scene", icon="VIEWZOOM")
        seconds, row = timing.expected_seconds(context.scene), row_if(session.current() is None, layout)
        if seconds is None:
            row.operator("lfsr.estimate_time", icon="TIME")
        else:
            row.label(text=f"About {duration(seconds)} per image", icon="TIME")
            row.operator("lfsr.estimate_time", text="", icon="FILE_REFRESH")
        if state.checked_scene != context.scene.name_full:
            return
        if last.has_changed():
            layout.label(text="Changed since this check", icon="INFO")
        if not state.problems:
            layout.label(text="No problems found", icon="CHECKMARK")
        draw_problems(layout, context)


class LFSR_PT_quality(LightFieldPanel, bpy.types.Panel):
    """How much time an image takes"""

    bl_label = "Quality"
    bl_order = 3

    def draw(self, context: bpy.types.Context) -> None:
        """Draw preset, rays, method, light, device and output."""
        lfsr, has_lenses = context.scene.lfsr, not scene_settings.renders_subpixels(context.scene)
        layout = columns(self.layout)
        layout.prop(lfsr, "quality", text="Preset")
        row_if(not lfsr.samples, layout).prop(lfsr, "rays")
        layout.prop(lfsr, "samples")
        with contextlib.suppress(LfsrError):  # the panel Display says what is wrong
            facts(self.layout, summary.sample_facts(scene_settings.resolve(context.scene)))
        layout = columns(self.layout)  # columns stand in the order in which they were made
        row_if(has_lenses, layout).prop(lfsr, "method")
        layout.prop(lfsr, "seed")
        layout.prop(lfsr, "light")
        if lfsr.light == FILE_LIGHT:
            layout.prop(lfsr, "light_file", text="File")
        if hasattr(context.scene, "cycles"):
            layout.prop(context.scene.cycles, "device")
            facts(self.layout, summary.device_facts(context.scene))
            if summary.lacks_gpu(context.scene):
                sentence(self.layout, "No GPU is set up in Preferences > System", "INFO", context)
        below = columns(self.layout)
        below.prop(lfsr, "output")
        if folders.waits_for_saving(context.scene):
            sentence(self.layout, UNSAVED_NOTE, "INFO", context)
            below = columns(self.layout)
        row_if(has_lenses, below).prop(lfsr, "linear_exr")


class LFSR_PT_plan(LightFieldPanel, bpy.types.Panel):
    """The cheapest settings that are accurate enough"""

    bl_label = "Find Cheapest Settings"
    bl_parent_id = "LFSR_PT_quality"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the target, the button and what it found last."""
        state = context.window_manager.lfsr
        columns(self.layout).prop(context.scene.lfsr, "plan_target")
        row_if(session.current() is None, self.layout).operator("lfsr.plan", text="Find", icon="VIEWZOOM")
        sentence(self.layout, summary.plan_cost(context.scene), "NONE", context)
        if state.plan_scene != context.scene.name_full:
            return
        sentence(self.layout, state.plan_text, "CHECKMARK" if state.plan_method else "INFO", context)
        if state.plan_method:
            self.layout.operator("lfsr.plan_use")


class LFSR_PT_render(LightFieldPanel, bpy.types.Panel):
    """Render, compare, preview and export"""

    bl_label = "Render"
    bl_order = 4

    def draw(self, context: bpy.types.Context) -> None:
        """Draw progress, buttons and the last error."""
        layout, task = self.layout, session.current()
        if task is not None:
            session.draw_progress(layout.row(align=True), task)
            if task.progress.detail and task.progress.stage not in session.ALONE:
                sentence(layout, task.progress.detail, "NONE", context)
        else:
            _draw_outcome(layout, context)
        column = layout.column()
        column.enabled = task is None
        column.scale_y = 1.2
        column.operator("lfsr.render_eia", icon="RENDER_STILL")
        column.operator("lfsr.render_animation", icon="RENDER_ANIMATION")
        column.menu("LFSR_MT_submit")
        # Without a column for labels, where this one would be cut off.
        has_lenses = not scene_settings.renders_subpixels(context.scene)
        row_if(has_lenses, layout).prop(context.scene.lfsr, "temporal_averaging")
        layout.prop(context.scene.lfsr, "use_overwrite")
        state = context.window_manager.lfsr
        if state.message:
            sentence(layout, state.message, "ERROR" if state.message_is_error else "INFO", context)
        with contextlib.suppress(LfsrError):  # said by the buttons
            if task is None and folders.is_unfinished(folders.frame_folder(context.scene)):
                sentence(layout, f"Frame {context.scene.frame_current} is rendered, but its image is not finished",
                         "INFO", context)
                layout.operator_menu_enum("lfsr.finish_frame", "method", text="Finish With")


class LFSR_PT_reference(LightFieldPanel, bpy.types.Panel):
    """How close the image is to its reference"""

    bl_label = "Reference"
    bl_parent_id = "LFSR_PT_render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw samples, lenses, the button and the last metrics."""
        layout, lfsr = columns(self.layout), context.scene.lfsr
        layout.prop(lfsr, "reference_samples")
        layout.prop(lfsr, "reference_lenses")
        row_if(session.current() is None, self.layout).operator("lfsr.render_reference", icon="RENDERLAYERS")
        found = summary.metric_facts(context.scene)
        if found:
            facts(self.layout, found, 0.65)


class LFSR_PT_preview(LightFieldPanel, bpy.types.Panel):
    """What an eye sees"""

    bl_label = "Preview"
    bl_parent_id = "LFSR_PT_render"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the button and the eye's position."""
        row_if(session.current() is None, self.layout).operator("lfsr.preview_view", icon="HIDE_OFF")
        column = columns(self.layout).column(align=True)
        column.enabled = preview.is_loaded(context.scene)
        column.prop(context.scene.lfsr, "eye_right", slider=True)
        column.prop(context.scene.lfsr, "eye_up", text="Up", slider=True)


class LFSR_PT_exports(LightFieldPanel, bpy.types.Panel):
    """The image on its display, and for those who have none"""

    bl_label = "View and Export"
    bl_parent_id = "LFSR_PT_render"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the viewer's button, the menu of formats and the buttons that show the image on its display."""
        row = row_if(session.current() is None, self.layout)
        row.operator("lfsr.open_viewer", icon="URL")
        row.menu("LFSR_MT_export", icon="EXPORT")
        row = row_if(session.current() is None, self.layout).row(align=True)
        row.operator("lfsr.show", icon="DESKTOP")
        if scene_settings.has_quilts(context.scene):
            row.operator("lfsr.show", text="", icon="FULLSCREEN_ENTER").full_screen = True
        row.operator("lfsr.show", text="", icon="RENDER_ANIMATION").animation = True


def _draw_fits(layout: bpy.types.UILayout, text: str) -> None:
    split = layout.split(factor=0.2)
    split.label(text=text)
    row = split.row(align=True)
    for name, title, _ in FIT_ITEMS:
        row.operator("lfsr.array_fit", text=title).to = name


def _draw_outcome(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """One quiet line on what was done, and what can be done with it."""
    state, scene = context.window_manager.lfsr, context.scene
    if state.outcome:
        layout.label(text=state.outcome, icon="CHECKMARK")
    if not state.outcome_folder:
        return
    row = layout.row(align=True)
    row.operator("wm.path_open", text="Open Folder").filepath = state.outcome_folder
    with contextlib.suppress(LfsrError):
        is_shown = str(folders.frame_folder(scene)) == state.outcome_folder
        if is_shown and not scene_settings.renders_subpixels(scene):
            row.operator("lfsr.preview_view", text="View")
            row.operator("lfsr.render_reference", text="Compare")


CLASSES = (*display_panel.CLASSES, LFSR_PT_array, LFSR_PT_check, LFSR_PT_quality, LFSR_PT_plan, LFSR_PT_render,
           LFSR_PT_preview, LFSR_PT_exports, LFSR_PT_reference)
