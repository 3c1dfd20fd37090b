"""Buttons of the live view."""

from __future__ import annotations

import bpy

from ...live import session, window
from ...live.scene import EYE, PANEL
from .base import Result, add_missing_array, reports_errors


class LFSR_OT_live_start(bpy.types.Operator):
    """Open a window for the display, which shows the light field as it renders"""

    bl_idname, bl_label, kind = "lfsr.live_start", "Start Live", PANEL

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Open the window, which follows the scene and its settings. A scene without a camera array gets one."""
        add_missing_array(context.scene)
        session.start(context.scene, self.kind)
        return {"FINISHED"}


class LFSR_OT_live_stop(bpy.types.Operator):
    """Close the live window"""

    bl_idname, bl_label, kind = "lfsr.live_stop", "Stop Live", PANEL

    def execute(self, _context: bpy.types.Context) -> Result:
        """Close it; the file is as before."""
        session.stop(self.kind)
        return {"FINISHED"}


class LFSR_OT_live_eye_start(bpy.types.Operator):
    """Open a window that shows what an eye in front of the display sees"""

    bl_idname, bl_label, kind = "lfsr.live_eye_start", "Show One Eye", EYE
    execute = LFSR_OT_live_start.execute


class LFSR_OT_live_eye_stop(bpy.types.Operator):
    """Close the eye's window"""

    bl_idname, bl_label, kind = "lfsr.live_eye_stop", "Hide Eye", EYE
    execute = LFSR_OT_live_stop.execute


class LFSR_OT_live_full_screen(bpy.types.Operator):
    """Make the live window full screen, or a window again"""

    bl_idname, bl_label = "lfsr.live_full_screen", "Full Screen"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        """Only while there is a live window: Blender's own would change otherwise."""
        return session.is_on()

    @reports_errors
    def execute(self, _context: bpy.types.Context) -> Result:
        """Toggle it: Blender's default keys have no shortcut for that."""
        window.toggle_full_screen(window.find(PANEL))
        return {"FINISHED"}


CLASSES = (LFSR_OT_live_start, LFSR_OT_live_stop, LFSR_OT_live_eye_start, LFSR_OT_live_eye_stop,
           LFSR_OT_live_full_screen)
