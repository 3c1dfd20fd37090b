"""Entries in Blender's own menus, where its search (F3) finds them by name, and presets in the panel's header."""

from __future__ import annotations

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ..scene.array import cached

SUBFOLDER = "lfsr/light_field"
SAVED = ("display", "profile_file", "subpixels", "scale", "rays", "samples", "method", "seed", "linear_exr",
         "reference_samples", "reference_lenses")


class LFSR_MT_render(bpy.types.Menu):
    """Light-field renders of this scene"""

    bl_label = "Light Field"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what the panel's buttons do, in the order of the work."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"  # elsewhere a render would block Blender until its end
        layout.operator("lfsr.render_eia", icon="RENDER_STILL")
        layout.operator("lfsr.render_animation", text="Render EIA Animation", icon="RENDER_ANIMATION")
        layout.separator()
        if cached.find(context.scene) is None:
            _draw_add(layout)
        layout.operator("lfsr.array_fit", text="Fit Camera Array to Selection")
        layout.operator("lfsr.check_scene")
        layout.separator()
        layout.operator("lfsr.preview_view")
        layout.operator("lfsr.open_viewer")
        layout.operator("lfsr.show")


def _draw_add(layout: bpy.types.UILayout) -> None:
    layout.operator("lfsr.array_add", text="Light Field Camera Array", icon="OUTLINER_OB_CAMERA")


def draw_render(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """End of the menu *Render*."""
    menu.layout.separator()
    menu.layout.menu("LFSR_MT_render", icon="CAMERA_STEREO")


def draw_camera(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """End of the menu *Add > Camera*."""
    _draw_add(menu.layout)


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


CLASSES = (LFSR_MT_render, LFSR_OT_preset_add, LFSR_PT_presets)
