"""Buttons of the live view."""

from __future__ import annotations

import bpy

from ...live import session
from ...live.scene import EYE, PANEL
from .base import Result, reports_errors


class LFSR_OT_live_start(bpy.types.Operator):
    """Open a window that shows the light field as it renders, to be put on the display"""

    bl_idname = "lfsr.live_start"
    bl_label = "Start Live"

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Open it and return; the view follows the scene."""
        session.start(context.scene)
        return {"FINISHED"}


class LFSR_OT_live_stop(bpy.types.Operator):
    """Close the live window"""

    bl_idname = "lfsr.live_stop"
    bl_label = "Stop Live"

    def execute(self, _context: bpy.types.Context) -> Result:
        """Close it; nothing of it stays in the file."""
        session.stop(PANEL)
        return {"FINISHED"}


class LFSR_OT_live_eye_start(bpy.types.Operator):
    """Open a window that shows what an eye in front of the display sees, for those without one"""

    bl_idname = "lfsr.live_eye_start"
    bl_label = "Show One Eye"

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Open it and return; the view follows the scene and the sliders."""
        session.start(context.scene, EYE)
        return {"FINISHED"}


class LFSR_OT_live_eye_stop(bpy.types.Operator):
    """Close the eye's window"""

    bl_idname = "lfsr.live_eye_stop"
    bl_label = "Hide Eye"

    def execute(self, _context: bpy.types.Context) -> Result:
        """Close it; nothing of it stays in the file."""
        session.stop(EYE)
        return {"FINISHED"}


CLASSES = (LFSR_OT_live_start, LFSR_OT_live_stop, LFSR_OT_live_eye_start, LFSR_OT_live_eye_stop)
