"""Panels of the sidebar's tab "Light Field": drawing only."""

from __future__ import annotations

import contextlib

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import duration

from ..check import last
from ..check.fixes import OPERATORS
from ..check.problem import MOST_ROWS
from ..jobs import preview, session, timing
from ..live import nodes
from ..live import session as live_session
from ..live.scene import EYE
from ..scene import devices, folders
from ..scene import settings as scene_settings
from ..scene.array import cached, rig
from ..scene.displays import PROFILE_FILE
from ..scene.light import FILE_LIGHT
from . import array_view, summary
from .drawing import LightFieldPanel, columns, facts, row_if, sentence
from .menus import LFSR_PT_presets
from .operators.array import FIT_ITEMS

UNSAVED_NOTE = "Images are lost when Blender quits, unless you save the file: they then move beside it"
HOW_TO_PLACE = "Drag the new window to the display and make it full screen. It follows all changes here"
ICONS = {"ERROR": "CANCEL", "WARNING": "ERROR", "INFO": "INFO"}
MOST_NAMES = 8  # of an expanded row


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


class LFSR_MT_scale(bpy.types.Menu):
    """One of this many views in each direction is rendered, the others are reconstructed"""

    bl_label = "Scale"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the scales that divide the display's views."""
        for name in scene_settings.offered_scales(context.scene):
            self.layout.prop_enum(context.scene.lfsr, "scale", name)


class LFSR_PT_display(LightFieldPanel, bpy.types.Panel):
    """The display that the image is for"""

    bl_label = "Display"
    bl_order = 0

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        """Draw the preset menu."""
        LFSR_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw profile, scale and resolutions."""
        lfsr = context.scene.lfsr
        self.layout.prop(lfsr, "display", text="")  # without a column for labels, where long names would be cut off
        if lfsr.display == PROFILE_FILE:
            columns(self.layout).prop(lfsr, "profile_file", text="File")
        if scene_settings.is_woven(context.scene):
            # Without a column for labels: its label is as long as the sidebar is wide.
            self.layout.prop(lfsr, "subpixels")
            row = self.layout.row(align=True)
            row.operator("lfsr.test_picture", text="Test Picture…")
            row.operator("lfsr.calibrate", text="Calibrate…")
        # The menu of scales, where Blender draws a property's.
        split = row_if(not scene_settings.renders_subpixels(context.scene), self.layout).split(factor=0.4)
        label = split.row()
        label.alignment = "RIGHT"
        label.label(text="Scale")
        split.menu("LFSR_MT_scale", text=lfsr.bl_rna.properties["scale"].enum_items[lfsr.scale].name)
        try:
            facts(self.layout, summary.display_facts(scene_settings.resolve(context.scene)))
        except LfsrError as error:
            sentence(self.layout, str(error), "ERROR", context)


def draw_problems(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the worst rows, and the others where the artist asks for them."""
    state = context.window_manager.lfsr
    rows = list(state.problems)
    for row in rows if state.all_problems else rows[:MOST_ROWS]:
        _draw(layout, row, context)
    if len(rows) > MOST_ROWS:
        text = "Fewer" if state.all_problems else f"{len(rows) - MOST_ROWS} More"
        icon = "DISCLOSURE_TRI_DOWN" if state.all_problems else "DISCLOSURE_TRI_RIGHT"
        layout.prop(state, "all_problems", text=text, icon=icon, emboss=False)


def _draw(layout: bpy.types.UILayout, row: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    box = layout.box().column()
    head = box.row(align=True)
    if row.count > 1:
        icon = "DISCLOSURE_TRI_DOWN" if row.expanded else "DISCLOSURE_TRI_RIGHT"
        head.prop(row, "expanded", text="", icon=icon, emboss=False)
    title = head.row()
    title.alert = row.severity == "ERROR"
    title.label(text=row.title, icon=ICONS[row.severity])
    if row.is_object:
        _select_button(head, row.code, row.target)
    sentence(box, row.reason, "NONE", context)
    if row.expanded:
        problems, column = last.problems(row.code), box.column(align=True)
        for problem in problems[:MOST_NAMES]:
            line = column.row(align=True)
            line.label(text=problem.target)
            if problem.is_object:
                _select_button(line, row.code, problem.target)
        if len(problems) > MOST_NAMES:
            column.label(text=f"and {len(problems) - MOST_NAMES:,} more")
    if row.fix and row.code in OPERATORS:
        name, settings = OPERATORS[row.code]
        asking = box.row()
        asking.operator_context = "INVOKE_DEFAULT"
        button = asking.operator(name, text=row.fix)
        for key, value in settings.items():
            setattr(button, key, value)
    elif row.fix:
        button = box.operator("lfsr.check_fix", text=row.fix)
        button.code, button.target = row.code, row.target


def _select_button(layout: bpy.types.UILayout, code: str, target: str) -> None:
    button = layout.operator("lfsr.check_select", text="", icon="RESTRICT_SELECT_OFF")
    button.code, button.target = code, target


class LFSR_PT_live(LightFieldPanel, bpy.types.Panel):
    """The light field in a window of its own, as it renders"""

    bl_label = "Live"
    bl_order = 5

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, the settings and the notes."""
        layout, lfsr = self.layout, context.scene.lfsr
        if live_session.is_on():
            layout.operator("lfsr.live_stop", icon="PAUSE")
            layout.operator("lfsr.live_full_screen", icon="FULLSCREEN_ENTER")
        else:
            layout.operator("lfsr.live_start", icon="PLAY")
        column, woven = columns(layout), scene_settings.is_woven(context.scene)
        row_if(not woven, column).prop(lfsr, "live_scale")
        row_if(not lfsr.live_samples, column).prop(lfsr, "live_rays")
        column.prop(lfsr, "live_samples")
        row_if(nodes.can_interpolate() and not woven, column).prop(lfsr, "live_smooth")
        row_if(devices.has_denoiser(), column).prop(lfsr, "live_denoise")
        row_if(devices.has_denoiser() and lfsr.live_denoise, column).prop(lfsr, "live_denoise_start")
        for text, icon in notes(context.scene):
            sentence(layout, text, icon, context)
        if live_session.is_on(EYE):
            layout.operator("lfsr.live_eye_stop", icon="HIDE_ON")
        else:
            layout.operator("lfsr.live_eye_start", icon="HIDE_OFF")
        column = columns(layout).column(align=True)
        for name in ("live_eye_right", "live_eye_up", "live_eye_near"):
            column.prop(lfsr, name, slider=True)
        if live_session.message(EYE):
            sentence(layout, live_session.message(EYE), "ERROR", context)


def notes(scene: bpy.types.Scene) -> list[tuple[str, str]]:
    """Sentences with their icons: what this Blender cannot do, and what to do now."""
    found = []
    if not nodes.can_interpolate():
        found.append(("This Blender's viewport compositor cannot interpolate: each rendered view is repeated. "
                      "Blender 5.0 and later can", "INFO"))
    if scene.lfsr.live_denoise and not devices.has_denoiser():
        found.append(("This Blender was built without a denoiser: the live view shows its noise", "INFO"))
    if live_session.is_on():
        problem = live_session.message()
        found.append((problem, "ERROR") if problem else ("The live window is exact", "CHECKMARK"))
        found.append((HOW_TO_PLACE, "INFO"))
    return found


CLASSES = (LFSR_MT_scale, LFSR_PT_display, LFSR_PT_array, LFSR_PT_check, LFSR_PT_quality, LFSR_PT_plan, LFSR_PT_render,
           LFSR_PT_preview, LFSR_PT_exports, LFSR_PT_reference, LFSR_PT_live)
