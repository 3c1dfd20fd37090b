"""Blender presets of display and quality settings, in the panel's header."""

from __future__ import annotations

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

SUBFOLDER = "lfsr/light_field"
SAVED = ("display", "profile_file", "subpixels", "scale", "rays", "samples", "method", "seed", "linear_exr",
         "reference_samples", "reference_lenses")


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


CLASSES = (LFSR_OT_preset_add, LFSR_PT_presets)
