"""Panels of the sidebar's tab "Light Field", their presets, and entries in Blender's own menus: drawing only.

What an artist needs first is open, all else is closed.
"""

import contextlib

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import WORLD_IMAGES

from .. import compat
from ..check import last
from ..check.problems import INFO, MOST_ROWS, Problem
from ..jobs import folders, images, session
from ..live import session as live_session
from ..live.scene import EYE, PANEL, can_interpolate
from ..scene import settings as scene_settings
from ..scene.array import rig
from ..scene.light import FILE_LIGHT
from ..scene.settings import PROFILE_FILE
from ..scene.words import counted
from . import array_view, drawing
from .drawing import LightFieldPanel, columns, facts, row_if, sentence
from .operators.array import FIT_ITEMS
from .operators.check import OPERATORS

UNSAVED_NOTE = "Images are lost when Blender quits, unless you save the file: they then move beside it"
HOW_TO_PLACE = "Drag the new window to the display and make it full screen. It follows all changes here"
ICONS = {"ERROR": "CANCEL", "WARNING": "ERROR", "INFO": "INFO"}
MOST_NAMES = 8  # of an expanded row
SUBFOLDER = "lfsr/light_field"
SAVED = ("display", "profile_file", "subpixels", "scale", "rays", "samples", "method", "seed", "linear_exr",
         "reference_samples", "reference_lenses")
VIEW_SCALE = 10.0  # of the view in the panel, in buttons; a sidebar of the usual width shows no more


class LFSR_PT_image(LightFieldPanel, bpy.types.Panel):
    """Render the light-field image of this scene"""

    bl_label = "Light Field"
    bl_options = set[str]()

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        LFSR_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        scene, state = context.scene, context.window_manager.lfsr
        layout, task = self.layout, session.current()
        layout.prop(scene.lfsr, "display", text="")  # without a column for labels, where long names would be cut off
        if scene.lfsr.display == PROFILE_FILE:
            columns(layout).prop(scene.lfsr, "profile_file", text="File")
        row = layout.row(align=True)
        row.scale_y = 1.4
        if task is None:
            row.operator("lfsr.render_eia", icon="RENDER_STILL")
        else:
            session.draw_progress(row, task)
            if task.progress.detail and task.progress.stage not in session.ALONE:
                sentence(layout, task.progress.detail, "NONE", context)
        try:
            layout.label(text=drawing.image_text(scene))
        except LfsrError as error:
            sentence(layout, str(error), "ERROR", context)
        # What was done, what the eye sees of it, and what can be done with it.
        if state.message:
            sentence(layout, state.message, "ERROR" if state.message_is_error else "INFO", context)
        if icon := images.icon(scene):
            layout.template_icon(icon_value=icon, scale=VIEW_SCALE)
            column = columns(layout).column(align=True)
            column.prop(scene.lfsr, "eye_right", slider=True)
            column.prop(scene.lfsr, "eye_up", text="Up", slider=True)
        if state.outcome_folder:
            row = layout.row(align=True)
            row.label(text=state.outcome, icon="CHECKMARK")
            row.operator("wm.path_open", text="Open Folder").filepath = state.outcome_folder
        elif state.outcome:
            layout.label(text=state.outcome, icon="CHECKMARK")
        with contextlib.suppress(LfsrError):  # said by the buttons
            if task is None and folders.is_unfinished(folders.frame_folder(scene)):
                text = f"Frame {scene.frame_current} is rendered, but its image is not finished"
                sentence(layout, text, "INFO", context)
                layout.operator_menu_enum("lfsr.finish_frame", "method", text="Finish With")
        _draw_checks(layout, context)


def _draw_checks(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """One line on what was found, which opens the rows."""
    state, row = context.window_manager.lfsr, layout.row(align=True)
    if state.checked_scene != context.scene.name_full:
        row.operator("lfsr.check_scene", text="Check Scene", icon="VIEWZOOM")
        return
    if problems := last.rows:
        serious = [problem for problem in problems if problem.severity != INFO]
        text = counted(len(serious), "Problem") if serious else counted(len(problems), "Note")
        row.prop(state, "show_problems", text=text, emboss=False,
                 icon="DISCLOSURE_TRI_DOWN" if state.show_problems else "DISCLOSURE_TRI_RIGHT")
    else:
        row.label(text="No problems found", icon="CHECKMARK")
    row.operator("lfsr.check_scene", text="Check Again" if last.changed else "", icon="FILE_REFRESH")
    if not state.show_problems:
        return
    for problem in problems if state.all_problems else problems[:MOST_ROWS]:
        _draw_problem(layout, problem, context)
    if len(problems) > MOST_ROWS:
        text = "Fewer" if state.all_problems else f"{len(problems) - MOST_ROWS} More"
        icon = "DISCLOSURE_TRI_DOWN" if state.all_problems else "DISCLOSURE_TRI_RIGHT"
        layout.prop(state, "all_problems", text=text, icon=icon, emboss=False)


def _draw_problem(layout: bpy.types.UILayout, row: Problem, context: bpy.types.Context) -> None:
    box, state = layout.box().column(), context.window_manager.lfsr
    head = box.row(align=True)
    if row.count > 1:
        icon = "DISCLOSURE_TRI_DOWN" if state.show_names else "DISCLOSURE_TRI_RIGHT"
        head.prop(state, "show_names", text="", icon=icon, emboss=False)
    title = head.row()
    title.alert = row.severity == "ERROR"
    title.label(text=row.title, icon=ICONS[row.severity])
    if row.is_object:
        _button(head, "lfsr.check_select", row, text="", icon="RESTRICT_SELECT_OFF")
    sentence(box, row.reason, "NONE", context)
    if row.count > 1 and state.show_names:
        problems, column = last.problems(row.code), box.column(align=True)
        for problem in problems[:MOST_NAMES]:
            line = column.row(align=True)
            line.label(text=problem.target)
            if problem.is_object:
                _button(line, "lfsr.check_select", problem, text="", icon="RESTRICT_SELECT_OFF")
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
        _button(box, "lfsr.check_fix", row, text=row.fix)


def _button(layout: bpy.types.UILayout, name: str, problem: Problem, **looks: str) -> None:
    button = layout.operator(name, **looks)
    button.code, button.target = problem.code, problem.target


class LFSR_PT_array(LightFieldPanel, bpy.types.Panel):
    """The camera array in the scene"""

    bl_label = "Camera Array"

    def draw(self, context: bpy.types.Context) -> None:
        scene, layout = context.scene, self.layout
        array, row = rig.drawn(scene)[0], layout.row(align=True)
        if array is None:
            row.operator("lfsr.array_add", text="Add", icon="OUTLINER_OB_CAMERA")
        else:
            row.operator("lfsr.look_through", icon="VIEW_CAMERA",
                         depress=array_view.is_looking(context.space_data, scene))
            row.operator("lfsr.array_remove", text="", icon="TRASH")
        split = layout.split(factor=0.2)
        split.label(text="Add at" if array is None else "Fit to")
        row = split.row(align=True)
        for name, title, _ in FIT_ITEMS:
            row.operator("lfsr.array_fit", text=title).to = name
        if array is None:
            return
        column = columns(layout).column()
        column.enabled = rig.why_not_editable(array) is None
        row = column.row(align=True)
        row.prop(scene.lfsr, "distance", text="Distance")
        row.operator("lfsr.select_plane", text="", icon="RESTRICT_SELECT_OFF")
        column.prop(scene.lfsr, "spacing", text="Spacing", slider=True)
        column.prop(scene.lfsr, "show_frustum")
        try:
            facts(layout, drawing.depth_facts(scene))
        except LfsrError as error:
            sentence(layout, str(error), "ERROR", context)


class LFSR_PT_quality(LightFieldPanel, bpy.types.Panel):
    """How much time an image takes"""

    bl_label = "Quality"

    def draw(self, context: bpy.types.Context) -> None:
        scene, lfsr = context.scene, context.scene.lfsr
        layout = columns(self.layout)
        layout.prop(lfsr, "quality", text="Preset")
        row_if(not lfsr.samples, layout).prop(lfsr, "rays")
        row_if(not scene_settings.renders_subpixels(scene), layout).prop(lfsr, "method")
        layout.prop(lfsr, "light")
        if lfsr.light.lower() in WORLD_IMAGES:
            layout.prop(lfsr, "light_strength")
        if lfsr.light == FILE_LIGHT:
            layout.prop(lfsr, "light_file", text="File")
        layout.prop(lfsr, "output")
        if folders.waits_for_saving(scene):
            sentence(self.layout, UNSAVED_NOTE, "INFO", context)
        row_if(session.current() is None, self.layout).operator("lfsr.estimate_time", icon="TIME")


class LFSR_PT_advanced(LightFieldPanel, bpy.types.Panel):
    """What decides how the rays are sent"""

    bl_label = "Advanced"
    bl_parent_id = "LFSR_PT_quality"

    def draw(self, context: bpy.types.Context) -> None:
        scene, lfsr, has_lenses = context.scene, context.scene.lfsr, not scene_settings.renders_subpixels(context.scene)
        if scene_settings.is_woven(scene):
            self.layout.prop(lfsr, "subpixels")  # its label is as long as the sidebar is wide
        # The menu of scales, where Blender draws a property's.
        split = row_if(has_lenses, self.layout).split(factor=0.4)
        label = split.row()
        label.alignment = "RIGHT"
        label.label(text="Scale")
        split.menu("LFSR_MT_scale", text=lfsr.bl_rna.properties["scale"].enum_items[lfsr.scale].name)
        layout = columns(self.layout)
        layout.prop(lfsr, "samples")
        layout.prop(lfsr, "seed")
        if hasattr(scene, "cycles"):
            layout.prop(scene.cycles, "device")
            if scene.cycles.device != "CPU" and scene_settings.device_of(scene) == "CPU":
                sentence(self.layout, "No GPU is set up in Preferences > System", "INFO", context)
        row_if(has_lenses, columns(self.layout)).prop(lfsr, "linear_exr")
        with contextlib.suppress(LfsrError):  # the first panel says what is wrong
            facts(self.layout, drawing.display_facts(scene_settings.resolve(scene)))


class LFSR_PT_plan(LightFieldPanel, bpy.types.Panel):
    """The cheapest settings that are accurate enough"""

    bl_label = "Find Cheapest Settings"
    bl_parent_id = "LFSR_PT_quality"

    def draw(self, context: bpy.types.Context) -> None:
        state = context.window_manager.lfsr
        columns(self.layout).prop(context.scene.lfsr, "plan_target")
        row_if(session.current() is None, self.layout).operator("lfsr.plan", text="Find", icon="VIEWZOOM")
        sentence(self.layout, drawing.plan_cost(context.scene), "NONE", context)
        if state.plan_scene != context.scene.name_full:
            return
        sentence(self.layout, state.plan_text, "CHECKMARK" if state.plan_method else "INFO", context)
        if state.plan_method:
            self.layout.operator("lfsr.plan_use")


class LFSR_PT_animation(LightFieldPanel, bpy.types.Panel):
    """Images of the timeline's frames"""

    bl_label = "Animation"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        row_if(session.current() is None, layout).operator("lfsr.render_animation", icon="RENDER_ANIMATION")
        # Without a column for labels, where this one would be cut off.
        row_if(not scene_settings.renders_subpixels(context.scene), layout).prop(context.scene.lfsr,
                                                                                 "temporal_averaging")
        layout.prop(context.scene.lfsr, "use_overwrite")
        row_if(session.current() is None, layout).menu("LFSR_MT_submit")


class LFSR_PT_exports(LightFieldPanel, bpy.types.Panel):
    """The image on its display, and for those who have none"""

    bl_label = "View and Export"

    def draw(self, context: bpy.types.Context) -> None:
        layout = row_if(session.current() is None, self.layout).column()
        row = layout.row(align=True)
        row.operator("lfsr.preview_view", icon="HIDE_OFF")
        row.operator("lfsr.open_viewer", icon="URL")
        layout.menu("LFSR_MT_export", icon="EXPORT")
        row = layout.row(align=True)
        row.operator("lfsr.show", icon="DESKTOP")
        if scene_settings.has_quilts(context.scene):
            row.operator("lfsr.show", text="", icon="FULLSCREEN_ENTER").full_screen = True
        row.operator("lfsr.show", text="", icon="RENDER_ANIMATION").animation = True
        if scene_settings.is_woven(context.scene):
            row = layout.row(align=True)
            row.operator("lfsr.test_picture", text="Test Picture…")
            row.operator("lfsr.calibrate", text="Calibrate…")


class LFSR_PT_live(LightFieldPanel, bpy.types.Panel):
    """The light field in a window of its own, as it renders"""

    bl_label = "Live"

    def draw(self, context: bpy.types.Context) -> None:
        layout, lfsr = self.layout, context.scene.lfsr
        row, is_on = layout.row(align=True), live_session.is_on()
        row.operator("lfsr.live", text="Stop Live" if is_on else "Start Live",
                     icon="PAUSE" if is_on else "PLAY").kind = PANEL
        if is_on:
            row.operator("lfsr.live_full_screen", icon="FULLSCREEN_ENTER")
        for text, icon in notes(context.scene):
            sentence(layout, text, icon, context)
        is_on = live_session.is_on(EYE)
        layout.operator("lfsr.live", text="Hide Eye" if is_on else "Show One Eye",
                        icon="HIDE_ON" if is_on else "HIDE_OFF").kind = EYE
        column = columns(layout).column(align=True)
        for name in ("live_eye_right", "live_eye_up", "live_eye_near"):
            column.prop(lfsr, name, slider=True)
        if live_session.message(EYE):
            sentence(layout, live_session.message(EYE), "ERROR", context)


class LFSR_PT_live_advanced(LightFieldPanel, bpy.types.Panel):
    """Settings that decide how quickly the live view converges"""

    bl_label = "Advanced"
    bl_parent_id = "LFSR_PT_live"

    def draw(self, context: bpy.types.Context) -> None:
        lfsr, column, woven = context.scene.lfsr, columns(self.layout), scene_settings.is_woven(context.scene)
        row_if(not woven, column).prop(lfsr, "live_scale")
        row_if(not lfsr.live_samples, column).prop(lfsr, "live_rays")
        column.prop(lfsr, "live_samples")
        row_if(can_interpolate() and not woven, column).prop(lfsr, "live_smooth")
        row_if(compat.has_denoiser(), column).prop(lfsr, "live_denoise")


def notes(scene: bpy.types.Scene) -> list[tuple[str, str]]:
    """Sentences with their icons: what this Blender cannot do, and what to do now."""
    sentences = []
    if not can_interpolate():
        sentences.append(("This Blender's viewport compositor cannot interpolate: each rendered view is repeated. "
                          "Blender 5.0 and later can", "INFO"))
    if scene.lfsr.live_denoise and not compat.has_denoiser():
        sentences.append(("This Blender was built without a denoiser: the live view shows its noise", "INFO"))
    if live_session.is_on():
        problem = live_session.message()
        sentences.append((problem, "ERROR") if problem else ("The live window is exact", "CHECKMARK"))
        sentences.append((HOW_TO_PLACE, "INFO"))
    return sentences


class LFSR_PT_reference(LightFieldPanel, bpy.types.Panel):
    """How close the image is to its reference"""

    bl_label = "Reference"

    def draw(self, context: bpy.types.Context) -> None:
        layout, lfsr = columns(self.layout), context.scene.lfsr
        layout.prop(lfsr, "reference_samples")
        layout.prop(lfsr, "reference_lenses")
        row_if(session.current() is None, self.layout).operator("lfsr.render_reference", icon="RENDERLAYERS")
        facts(self.layout, drawing.metric_facts(context.scene), 0.65)


class LFSR_MT_scale(bpy.types.Menu):
    """One of this many views in each direction is rendered, the others are reconstructed"""

    bl_label = "Scale"

    def draw(self, context: bpy.types.Context) -> None:
        for name in scene_settings.offered_scales(context.scene):
            self.layout.prop_enum(context.scene.lfsr, "scale", name)


class LFSR_MT_render(bpy.types.Menu):
    """Light-field renders of this scene"""

    bl_label = "Light Field"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"  # elsewhere a render would block Blender until its end
        layout.operator("lfsr.render_eia", icon="RENDER_STILL")
        layout.operator("lfsr.render_animation", text="Render EIA Animation", icon="RENDER_ANIMATION")
        layout.separator()
        if rig.drawn(context.scene)[0] is None:
            draw_camera(self, context)
        layout.operator("lfsr.array_fit", text="Fit Camera Array to Selection")
        layout.operator("lfsr.check_scene")
        layout.separator()
        layout.operator("lfsr.preview_view")
        layout.operator("lfsr.open_viewer")
        layout.operator("lfsr.show")


def draw_render(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """End of the menu *Render*."""
    menu.layout.separator()
    menu.layout.menu("LFSR_MT_render", icon="CAMERA_STEREO")


def draw_camera(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """End of the menu *Add > Camera*."""
    menu.layout.operator("lfsr.array_add", text="Light Field Camera Array", icon="OUTLINER_OB_CAMERA")


def register() -> None:
    """Append the entries."""
    bpy.types.TOPBAR_MT_render.append(draw_render)
    bpy.types.VIEW3D_MT_camera_add.append(draw_camera)


def unregister() -> None:
    """Remove them again."""
    bpy.types.VIEW3D_MT_camera_add.remove(draw_camera)
    bpy.types.TOPBAR_MT_render.remove(draw_render)


class LFSR_OT_preset_add(AddPresetBase, bpy.types.Operator):
    """Add or remove a light-field preset of display, scale, rays and method"""

    bl_idname = "lfsr.preset_add"
    bl_label = "Add Light Field Preset"
    preset_menu = "LFSR_PT_presets"
    preset_subdir = SUBFOLDER
    # Lines of the preset file; they are executed in this order.
    preset_defines = ("import bpy", "lfsr = bpy.context.scene.lfsr")
    preset_values = tuple(f"lfsr.{name}" for name in SAVED)


class LFSR_PT_presets(PresetPanel, bpy.types.Panel):
    """Menu of the presets"""

    bl_label = "Light Field Presets"
    preset_subdir = SUBFOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = LFSR_OT_preset_add.bl_idname


CLASSES = (LFSR_MT_render, LFSR_OT_preset_add, LFSR_PT_presets, LFSR_MT_scale, LFSR_PT_image, LFSR_PT_array,
           LFSR_PT_quality, LFSR_PT_plan, LFSR_PT_advanced, LFSR_PT_animation, LFSR_PT_exports, LFSR_PT_live,
           LFSR_PT_live_advanced, LFSR_PT_reference)
