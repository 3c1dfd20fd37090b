"""Buttons of the camera array: add, fit, remove, select its display plane."""

from __future__ import annotations

import bpy

from lfsr_core.errors import LfsrError

from ...array import edit, rig
from ...settings import scene_settings
from .base import UNDO, Result, activate, reports_errors


class LFSR_OT_array_add(bpy.types.Operator):
    """Add a light-field camera array at the active camera, or in front of the objects if there is none"""

    bl_idname = "lfsr.array_add"
    bl_label = "Add Camera Array"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Add it and make its display plane the active object."""
        array = edit.add(context.scene, scene_settings.display_of(context.scene))
        activate(context, rig.plane_of(array))
        return {"FINISHED"}


class LFSR_OT_array_fit(bpy.types.Operator):
    """Move the camera array in front of the selected objects, so that they fill the display and its usable depth"""

    bl_idname = "lfsr.array_fit"
    bl_label = "Fit Camera Array to Selection"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Fit it; the selection stays."""
        scene = context.scene
        items = [item for item in context.selected_objects if not rig.is_array(item) and rig.PLANE not in item]
        edit.fit(scene, scene_settings.display_of(scene), items)
        return {"FINISHED"}


class LFSR_OT_array_remove(bpy.types.Operator):
    """Remove the light-field camera array from the scene"""

    bl_idname = "lfsr.array_remove"
    bl_label = "Remove Camera Array"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Remove viewing position and display plane."""
        edit.remove(context.scene)
        return {"FINISHED"}


class LFSR_OT_select_plane(bpy.types.Operator):
    """Select the display plane, which can be moved along the view"""

    bl_idname = "lfsr.select_plane"
    bl_label = "Select Display Plane"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Select the handle and nothing else."""
        array = rig.find(context.scene)
        plane = rig.plane_of(array) if array else None
        if plane is None:
            raise LfsrError("there is no display plane to select: add a camera array")
        activate(context, plane)
        return {"FINISHED"}


CLASSES = (LFSR_OT_array_add, LFSR_OT_array_fit, LFSR_OT_array_remove, LFSR_OT_select_plane)
