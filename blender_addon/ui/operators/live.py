"""Buttons of the live view."""

from __future__ import annotations

import bpy

from ...live import session
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
        session.stop()
        return {"FINISHED"}


CLASSES = (LFSR_OT_live_start, LFSR_OT_live_stop)
