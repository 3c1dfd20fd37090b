"""Base of the buttons: errors become reports, and a task is started or waited for."""

import dataclasses
import functools
from collections.abc import Callable

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import system_errors

from ...jobs import session
from ...jobs.session import Job
from ...live import session as live
from ...live.scene import MARK
from ...scene import settings as scene_settings
from ...scene.array import edit, rig
from ...scene.words import capitalized, for_panel
from ...scene.words import sentence as worded
from ..drawing import sentence

UNDO = {"REGISTER", "UNDO"}
DIALOG_WIDTH = 600
Result = set[str]


def reports_errors(method: Callable[..., Result]) -> Callable[..., Result]:
    """Report an LfsrError of an operator's method, and cancel the operator; leave Edit Mode while the method runs."""
    # Blender counts the arguments of the methods that it calls: no *arguments here.
    @functools.wraps(method)
    def wrapped(self: bpy.types.Operator, context: bpy.types.Context) -> Result:
        change = bpy.ops.object.mode_set  # in Edit Mode each ray through a large mesh takes hundredths of a second
        edited = context.active_object if context.mode.startswith("EDIT") and change.poll() else None
        try:
            with system_errors():
                if MARK in context.scene and not live.is_on(getattr(self, "kind", "")):  # the live button closes it
                    raise LfsrError("this window shows the light field itself: press the button in your scene's window")
                if edited is not None:
                    change(mode="OBJECT")
                return method(self, context)
        except LfsrError as error:
            self.report({"ERROR"}, capitalized(str(error)) if bpy.app.background else for_panel(str(error)))
            return {"CANCELLED"}
        finally:
            if edited is not None and context.active_object == edited and context.mode == "OBJECT":
                change(mode="EDIT")
    return wrapped


@dataclasses.dataclass(frozen=True)
class Question:
    """What an artist is asked before a task starts."""

    sentence: str  # what is wrong
    button: str  # starts the task all the same
    advice: str = ""  # what a script can do about it, which gets an error; empty if a script goes on
    more: str = ""  # another sentence
    accept: Callable[[], None] = lambda: None  # what the button does before the task starts
    mend: str = ""  # the operator's property that decides whether ``mends`` is called too
    title: str = ""  # of that property's check box
    mends: Callable[[], None] = lambda: None


class TaskOperator:
    """An operator that starts the task that its ``prepare`` returns.

    Pressed in a window it asks its ``questions``, returns at once and a timer follows the task; called from a script or
    in background mode it returns when the result is there.
    """

    bl_label: str
    report: Callable[[set[str], str], None]
    layout: bpy.types.UILayout
    asked: list[Question] | None = None  # in the dialog

    def questions(self, _context: bpy.types.Context) -> list[Question]:
        """Return what to ask before the task starts."""
        return []

    def prepare(self, context: bpy.types.Context) -> Job | None:
        """Return the job to start; None if there is nothing to do."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        """Ask, start and return at once; in background mode wait for the end."""
        return self.execute(context) if bpy.app.background else self.ask(context)

    @reports_errors
    def ask(self, context: bpy.types.Context) -> Result:
        """Show a dialog with the questions; start where there are none."""
        session.check_idle()
        self.asked = self.questions(context)
        if not self.asked:
            return self.start(context)
        for question in self.asked:
            if question.mend:
                setattr(self, question.mend, True)
        answer: Result = context.window_manager.invoke_props_dialog(
            self, width=DIALOG_WIDTH, title=self.bl_label, confirm_text=self.asked[0].button)
        return answer

    def draw(self, context: bpy.types.Context) -> None:
        for question in self.asked or ():
            if question.mend:
                self.layout.prop(self, question.mend, text=question.title)
            sentence(self.layout, f"{question.sentence}.", "BLANK1" if question.mend else "QUESTION", context,
                     DIALOG_WIDTH)
            if question.more:
                sentence(self.layout, f"{question.more}.", "BLANK1", context, DIALOG_WIDTH)

    @reports_errors
    def start(self, context: bpy.types.Context) -> Result:
        """Start the task, which a timer follows."""
        session.check_idle()
        if (job := self.prepare(context)) is not None:
            session.start(self.bl_label, job)
        return {"FINISHED"}

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Run the task to its end; after the dialog, start it."""
        if self.asked:
            for question in self.asked:
                question.accept()
            self._mend(self.asked)
            return self.start(context)
        session.check_idle()
        questions = self.questions(context)
        for question in questions:
            if question.advice:
                raise LfsrError(f"{question.sentence}: {question.advice}")
        self._mend(questions)
        if (job := self.prepare(context)) is not None:
            task = session.run(self.bl_label, job)
            for notice in task.notices:
                self.report({"WARNING"}, worded(notice))
            job.finish(task.result or {})
        return {"FINISHED"}

    def _mend(self, questions: list[Question]) -> None:
        chosen = [question for question in questions if question.mend and getattr(self, question.mend)]
        for question in chosen:
            question.mends()
        if chosen:
            bpy.ops.ed.undo_push(message=" and ".join(question.title for question in chosen))


class DescribedByItem:
    """An operator whose tooltip is that of the value of its enumeration ``item``."""

    item: str

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the tooltip of a button."""
        return str(properties.bl_rna.properties[cls.item].enum_items[getattr(properties, cls.item)].description)


class AsksForFile:
    """An operator that shows the file browser before it is executed."""

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        """Ask for the file or the folder."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


def add_missing_array(scene: bpy.types.Scene) -> None:
    """Add a camera array where the scene has none, with an undo step of its own; LfsrError where that cannot be."""
    if rig.find(scene) is None:
        edit.add(scene, scene_settings.display_of(scene))
        bpy.ops.ed.undo_push(message="Add Camera Array")


def activate(context: bpy.types.Context, item: bpy.types.Object) -> None:
    """Make ``item`` the active and only selected object; LfsrError if it is not in the view layer."""
    if item.name not in context.view_layer.objects:
        raise LfsrError(f"{item.name!r} is not in this view layer: switch its collection on")
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for other in context.view_layer.objects:
        other.select_set(other == item)
    context.view_layer.objects.active = item
