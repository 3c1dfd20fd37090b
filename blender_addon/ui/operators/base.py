"""What the buttons share: errors become reports, and a task is started or waited for."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.files import system_errors

from ...background import session
from ...background.steps import Steps

UNDO = {"REGISTER", "UNDO"}
Result = set[str]
# The steps of a task, and what to do with its result.
Prepared = tuple[Steps, Callable[[Any], None]]


def reports_errors(method: Callable[..., Result]) -> Callable[..., Result]:
    """An LfsrError inside the operator's method becomes its report, and the operator is cancelled."""
    # Blender counts the arguments of what it calls: no *arguments here.
    @functools.wraps(method)
    def wrapped(self: bpy.types.Operator, context: bpy.types.Context) -> Result:
        try:
            with system_errors():
                return method(self, context)
        except LfsrError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
    return wrapped


class TaskOperator:
    """An operator that starts a task, the one that its ``prepare`` returns."""

    def prepare(self, context: bpy.types.Context) -> Prepared | None:
        """Steps and what to do with their result; None if there is nothing to do."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        """Start and return at once; in background mode as ``execute``."""
        return self.execute(context) if bpy.app.background else self.start(context)

    @reports_errors
    def start(self, context: bpy.types.Context) -> Result:
        """Start the task; a timer follows it."""
        session.check_idle()
        prepared = self.prepare(context)
        if prepared is not None:
            session.start(self.bl_label, *prepared)
        return {"FINISHED"}

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Return when the result is there."""
        session.check_idle()
        prepared = self.prepare(context)
        if prepared is None:
            return {"FINISHED"}
        steps, finish = prepared
        task = session.run(self.bl_label, steps)
        for warning in task.warnings:
            self.report({"WARNING"}, warning)
        finish(task.result)
        return {"FINISHED"}


def activate(context: bpy.types.Context, item: bpy.types.Object) -> None:
    """Make ``item`` the active and only selected object; LfsrError if it is not in the view layer."""
    if item.name not in context.view_layer.objects:
        raise LfsrError(f"{item.name!r} is not in this view layer: switch its collection on")
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for other in context.view_layer.objects:
        other.select_set(other == item)
    context.view_layer.objects.active = item
