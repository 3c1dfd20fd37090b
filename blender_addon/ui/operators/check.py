"""Buttons of the scene check: run it, select an object, fix a problem."""

from __future__ import annotations

import bpy

from lfsr_core.errors import LfsrError

from ...array.rig import check_editable
from ...background import session
from ...check.fixes import FIXES, OUTSIDE_SCENE, find_object
from ...check.problems import INFO, Problem, check_scene
from ...settings.words import counted
from .base import UNDO, Result, activate, reports_errors


class LFSR_OT_check_scene(bpy.types.Operator):
    """List what will go wrong with this scene on this display"""

    bl_idname = "lfsr.check_scene"
    bl_label = "Check Scene"

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Check the scene and report the number of problems."""
        problems = refresh(context.scene)
        serious = [problem for problem in problems if problem.severity != INFO]
        if serious:
            self.report({"WARNING"}, f"{counted(len(serious), 'problem')} found, first {serious[0].target}: "
                        f"{serious[0].reason}")
        else:
            ignored = f"; renders ignore {counted(len(problems), 'setting')}" if problems else ""
            self.report({"INFO"}, f"No problems found{ignored}")
        return {"FINISHED"}


class LFSR_OT_check_select(bpy.types.Operator):
    """Select the object that has the problem"""

    bl_idname = "lfsr.check_select"
    bl_label = "Select Object with Problem"
    bl_options = UNDO

    target: bpy.props.StringProperty(name="Name", description="Object to select")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Select it and nothing else."""
        activate(context, find_object(self.target))
        return {"FINISHED"}


class LFSR_OT_check_fix(bpy.types.Operator):
    """Fix the problem"""

    bl_idname = "lfsr.check_fix"
    bl_label = "Fix Problem"
    bl_options = UNDO

    code: bpy.props.StringProperty(name="Code", description="Kind of problem")
    target: bpy.props.StringProperty(name="Name", description="What has the problem")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Fix it and check again."""
        if self.code not in FIXES:
            raise LfsrError(f"problem {self.code!r} cannot be fixed by a button: choose one of {', '.join(FIXES)}")
        if self.code not in OUTSIDE_SCENE:
            check_editable(context.scene)
        FIXES[self.code](context.scene, self.target)
        refresh(context.scene)
        return {"FINISHED"}


def refresh(scene: bpy.types.Scene) -> list[Problem]:
    """Check ``scene`` and fill the panel's list."""
    state, problems = bpy.context.window_manager.lfsr, check_scene(scene)
    state.checked_scene = scene.name_full
    state.problems.clear()
    for problem in problems:
        line = state.problems.add()
        for name in ("code", "target", "reason", "fix", "severity", "is_object"):
            setattr(line, name, getattr(problem, name))
    session.redraw()
    return problems


CLASSES = (LFSR_OT_check_scene, LFSR_OT_check_select, LFSR_OT_check_fix)
