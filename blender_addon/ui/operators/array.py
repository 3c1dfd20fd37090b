"""Buttons of the camera array: add, fit, remove, select its display plane."""

import bpy

from lfsr_core.base.messages import LfsrError

from ...scene import settings as scene_settings
from ...scene.array import edit, rig
from .. import array_view
from ..properties import forget_message
from .base import UNDO, DescribedByItem, Result, activate, reports_errors

FIT_ITEMS = [
    ("SELECTION", "Selection", "Move the camera array in front of the selected objects, so that they fill the display "
     "and its usable depth"),
    ("VIEW", "View", "Move the camera array to the 3D view's eye, so that the display shows what you see now"),
    ("CAMERA", "Camera", "Move the camera array to the active camera, with its direction and field of view")]


class LFSR_OT_array_add(bpy.types.Operator):
    """Add a light-field camera array at the active camera, or in front of the objects if there is none"""

    bl_idname = "lfsr.array_add"
    bl_label = "Add Camera Array"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        edit.add(context.scene, scene_settings.display_of(context.scene))
        return {"FINISHED"}


class LFSR_OT_array_fit(DescribedByItem, bpy.types.Operator):
    """Move the camera array, so that the display shows what you see or select"""

    bl_idname = "lfsr.array_fit"
    bl_label = "Fit Camera Array"
    item = "to"
    bl_options = UNDO

    to: bpy.props.EnumProperty(name="Fit To", description="What the display should show", items=FIT_ITEMS)

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Fit it; the selection stays, and what was said of the last image goes."""
        forget_message()
        scene, display = context.scene, scene_settings.display_of(context.scene)
        if self.to == "CAMERA":
            edit.fit_to_camera(scene, display)
        elif self.to == "VIEW":
            if context.area is None or context.area.type != "VIEW_3D":
                raise LfsrError("there is no 3D view here: press the button in the sidebar of a 3D view")
            if array_view.is_looking(context.space_data, scene):
                raise LfsrError("this view looks through the camera array already: leave it first")
            edit.fit_to_view(scene, display, array_view.view_of(context.area, display))
        else:
            items = [item for item in context.selected_objects if not rig.is_array(item) and rig.PLANE not in item]
            edit.fit(scene, display, items)
        return {"FINISHED"}


class LFSR_OT_array_remove(bpy.types.Operator):
    """Remove the light-field camera array from the scene"""

    bl_idname = "lfsr.array_remove"
    bl_label = "Remove Camera Array"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        edit.remove(context.scene)
        return {"FINISHED"}


class LFSR_OT_select_plane(bpy.types.Operator):
    """Select the display plane, which can be moved along the view"""

    bl_idname = "lfsr.select_plane"
    bl_label = "Select Display Plane"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        if (plane := rig.plane_of(rig.find(context.scene))) is None:
            raise LfsrError("there is no display plane to select: add a camera array")
        activate(context, plane)
        return {"FINISHED"}


class LFSR_OT_look_through(bpy.types.Operator):
    """See the scene from the viewing position in the display's frame; press again to return to your own view"""

    bl_idname = "lfsr.look_through"
    bl_label = "Look Through Array"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        if array_view.is_looking(context.space_data, context.scene):
            array_view.leave(context.area)
        else:
            array_view.enter(context.area, context.scene)
        return {"FINISHED"}


CLASSES = (LFSR_OT_array_add, LFSR_OT_array_fit, LFSR_OT_array_remove, LFSR_OT_select_plane, LFSR_OT_look_through)
