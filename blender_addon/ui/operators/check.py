"""Buttons of the scene check: run it, select an object, fix a problem."""

from __future__ import annotations

import functools

import bpy

from lfsr_core.base.messages import LfsrError, duration

from ...check import last
from ...check.fixes import FIXES, OUTSIDE_SCENE, find_object
from ...check.look import MENDS
from ...check.problem import INFO, MOST_ROWS, Problem, grouped
from ...check.problems import to_ask
from ...jobs.asked import expected_seconds
from ...scene.array.rig import check_editable
from ...scene.words import counted, for_panel
from .base import UNDO, AsksForFile, Question, Result, activate, reports_errors

LONG = 600.0  # seconds of a render that is asked about
_accepted: set[tuple[str, str, str]] = set()  # what the artist was asked in this file


class LFSR_OT_check_scene(bpy.types.Operator):
    """List what will go wrong with this scene on this display"""

    bl_idname = "lfsr.check_scene"
    bl_label = "Check Scene"

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        problems = last.check(context.scene)
        serious = [problem for problem in problems if problem.severity != INFO]
        if serious:
            self.report({"WARNING"}, f"{counted(len(serious), 'problem')} found, first {serious[0].target}: "
                        f"{for_panel(serious[0].reason)}")
        else:
            ignored = f"; renders ignore {counted(len(problems), 'setting')}" if problems else ""
            self.report({"INFO"}, f"No problems found{ignored}")
        return {"FINISHED"}


class LFSR_OT_check_select(bpy.types.Operator):
    """Select the objects that have the problem"""

    bl_idname = "lfsr.check_select"
    bl_label = "Select Objects with Problem"
    bl_options = UNDO

    code: bpy.props.StringProperty(name="Code", description="Kind of problem")
    target: bpy.props.StringProperty(name="Name", description="Object to select, empty for all with the problem")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        names = [self.target] if self.target else [problem.target for problem in last.problems(self.code)]
        items = [find_object(name) for name in names]
        if not items:
            raise LfsrError("no object has this problem any more: check the scene again")
        activate(context, items[0])
        for item in items:
            if item.name in context.view_layer.objects:
                item.select_set(True)
        return {"FINISHED"}


class LFSR_OT_check_fix(bpy.types.Operator):
    """Fix the problem"""

    bl_idname = "lfsr.check_fix"
    bl_label = "Fix Problem"
    bl_options = UNDO

    code: bpy.props.StringProperty(name="Code", description="Kind of problem")
    target: bpy.props.StringProperty(name="Name", description="What has the problem, empty for all that have it")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        if self.code not in FIXES:
            raise LfsrError(f"problem {self.code!r} cannot be fixed by a button: choose one of {', '.join(FIXES)}")
        if self.code not in OUTSIDE_SCENE:
            check_editable(context.scene)
        every = [problem.target for problem in last.problems(self.code)]
        for target in [self.target] if self.target or len(every) < 2 else every:
            FIXES[self.code](context.scene, target)
        last.check(context.scene)
        return {"FINISHED"}


class LFSR_OT_choose_output(AsksForFile, bpy.types.Operator):
    """Choose another folder for the images of this scene"""

    bl_idname = "lfsr.choose_output"
    bl_label = "Choose Output Folder"
    bl_options = UNDO

    directory: bpy.props.StringProperty(
        name="Folder", description="Folder for the images of this scene", subtype="DIR_PATH",
        options={"SKIP_SAVE", "PATH_SUPPORTS_BLEND_RELATIVE"})
    filter_folder: bpy.props.BoolProperty(
        name="Folders", description="Show folders only", default=True, options={"HIDDEN"})

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        check_editable(context.scene)
        context.scene.lfsr.output = self.directory
        last.check(context.scene)
        return {"FINISHED"}


def questions(scene: bpy.types.Scene, frames: int = 1) -> list[Question]:
    """Return what an artist is asked before ``frames`` images of ``scene``, once for each thing in a file."""
    new = [problem for problem in to_ask(scene, frames) if _key(scene, problem) not in _accepted]
    accept = functools.partial(_accepted.update, [_key(scene, problem) for problem in new])
    mends = [problem for code in MENDS for problem in new if problem.code == code]
    rows = grouped(problem for problem in new if problem.code not in MENDS)
    asked = [*(Question(problem.reason.rstrip("."), "Render", accept=accept, mend=MENDS[problem.code][0],
                        title=problem.fix, mends=functools.partial(FIXES[problem.code], scene, problem.target))
               for problem in mends),
             *_long(scene, frames), *(
                 Question((row.reason if row.count == 1 else f"{row.title}. {row.reason}").rstrip("."), "Render",
                          accept=accept) for row in rows[:MOST_ROWS])]
    if len(rows) > MOST_ROWS:
        asked.append(Question(f"Scene Check lists {len(rows) - MOST_ROWS} more", "Render", accept=accept))
    return asked


def _long(scene: bpy.types.Scene, frames: int) -> list[Question]:
    """Ask before images that will take long, again where they will take longer than was accepted."""
    seconds = frames * (expected_seconds(scene) or 0.0)
    what = "The image" if frames == 1 else f"{frames} images"
    key = scene.name_full, "time", f"{max(seconds, 1.0):.0e}"
    if seconds < LONG or key in _accepted:
        return []
    return [Question(f"{what} will take about {duration(seconds)}", "Render",
                     accept=functools.partial(_accepted.add, key))]


def _key(scene: bpy.types.Scene, problem: Problem) -> tuple[str, str, str]:
    return scene.name_full, problem.code, problem.target


@bpy.app.handlers.persistent
def _forget(*_: object) -> None:
    _accepted.clear()


unregister = _forget
HANDLERS = (("load_post", _forget),)
CLASSES = (LFSR_OT_check_scene, LFSR_OT_check_select, LFSR_OT_check_fix, LFSR_OT_choose_output)
