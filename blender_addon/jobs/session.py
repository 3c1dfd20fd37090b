"""The task that runs now: started by a button, followed by a timer, shown in the status bar."""

from __future__ import annotations

import atexit
import dataclasses
import textwrap

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import system_errors

from ..scene.words import capitalized, clock, for_panel, sentence
from . import images
from .task import Job, Task

SECONDS_BETWEEN_LOOKS = 0.1
POPUP_COLUMNS = 90
STATUS_WIDTH = 12  # of the progress in the status bar, in Blender's units
MOST_NOTICES = 3  # that a panel shows
# What the panel calls the stages of the work.
TITLES = {"save": "Saving a copy of the file", "open": "Opening the scene", "render": "Rendering",
          "frames": "Rendering", "reference": "Rendering reference", "finish": "Finishing", "load": "Finishing",
          "average": "Averaging frames", "upscale": "Upscaling", "denoise": "Denoising", "color": "Finishing",
          "weave": "Finishing", "write": "Finishing", "views": "Decoding views", "decode": "Decoding views",
          "compare": "Comparing", "view": "Writing viewer", "export": "Exporting", "encode": "Encoding",
          "show": "Showing", "first": "First view", "plan": "Measuring lenses", "estimate": "Measuring lenses"}
ALONE = ("save", "open", "first")  # stages that say more than their fractions

_current: Task | None = None


def current() -> Task | None:
    """The task that runs now, None if there is none."""
    return _current


def check_idle() -> None:
    """LfsrError if something renders already, here or in Blender itself."""
    if _current is not None:
        raise LfsrError(f"{_current.title} is still running: wait for it or cancel it")
    if bpy.app.is_job_running("RENDER"):
        raise LfsrError("Blender is rendering: wait for it or cancel it")


def start(title: str, job: Job) -> Task:
    """Follow ``job`` from a timer and call its ``finish`` with the result."""
    global _current
    check_idle()
    _current = Task(title, job)
    state = bpy.context.window_manager.lfsr
    state.message = state.outcome = state.outcome_folder = ""
    # Persistent: opening another file must not orphan the process.
    bpy.app.timers.register(_look, first_interval=SECONDS_BETWEEN_LOOKS, persistent=True)
    redraw()  # what Blender is busy with next is read before it is
    return _current


def run(title: str, job: Job) -> Task:
    """Run ``job`` to its end and return the task, for scripts and background mode."""
    global _current
    check_idle()
    _current = task = Task(title, job)
    try:
        task.run()
        return task
    finally:
        _current = None


def cancel() -> Task | None:
    """Stop what runs and return it; None if nothing ran."""
    global _current
    task, _current = _current, None
    if task is not None:
        task.cancel()
        redraw()
    return task


def _look() -> float | None:
    """Timer: poll the task; its result or an error ends it."""
    global _current
    if (task := _current) is None:
        return None
    try:
        with system_errors():
            ended = task.poll()
        if not ended:
            redraw()
            return SECONDS_BETWEEN_LOOKS
        _current = None
        say(". ".join(sentence(notice) for notice in task.notices[-MOST_NOTICES:]))
        bpy.context.window_manager.lfsr.outcome = f"Done in {clock(task.seconds)}"
        task.job.finish(task.result or {})
    except LfsrError as error:
        message = ". ".join(filter(None, (str(error), task.job.kept())))
        say(message, is_error=True)
        _pop_up(message, "ERROR")  # no operator can report it
    finally:
        # Also after an unexpected error: a task that cannot go on must not block the next.
        if task.ended:
            _current = None
    redraw()
    return None


def say(message: str, is_error: bool = False) -> None:
    """Show a sentence in the panel only; an empty one removes the last."""
    state = bpy.context.window_manager.lfsr
    state.message, state.message_is_error = capitalized(message), is_error
    if message:
        print(f"Light Field: {message}")


def tell(message: str, icon: str) -> None:
    """Show a sentence beside the pointer only."""
    print(f"Light Field: {message}")
    _pop_up(message, icon)


def _pop_up(message: str, icon: str) -> None:
    windows = bpy.context.window_manager.windows
    if bpy.app.background or not windows:
        return

    def draw(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
        for line in textwrap.wrap(for_panel(message), POPUP_COLUMNS):
            menu.layout.label(text=line)

    # The window that no other hides: of those that lie over others, the newest.
    window = next((window for window in reversed(windows) if window.parent is not None), windows[0])
    with bpy.context.temp_override(window=window):
        bpy.context.window_manager.popup_menu(draw, title="Light Field", icon=icon)


def redraw() -> None:
    """Redraw the sidebars and the status bar of every window."""
    images.redraw_sidebars()
    for window in bpy.context.window_manager.windows:
        # Python cannot tag the status bar for a redraw; a running tool's own text must stay.
        if not bpy.app.background and not getattr(window, "modal_operators", ()):
            with bpy.context.temp_override(window=window):
                window.workspace.status_text_set_internal(None)


def draw_status(header: bpy.types.Header, _context: bpy.types.Context) -> None:
    """Left end of the status bar while a task runs."""
    if _current is not None:
        row = header.layout.row(align=True)
        row.ui_units_x = STATUS_WIDTH  # else Blender cuts the text
        draw_progress(row, _current)


def draw_progress(row: bpy.types.UILayout, task: Task) -> None:
    """Draw the stage and the time left, and the cancel button."""
    row.progress(factor=task.fraction, text=progress_text(task))
    row.operator("lfsr.cancel", text="", icon="X")


def progress_text(task: Task) -> str:
    """Stage, percentage and time left, as in "Rendering 42%, 0:31 left"; first that the file is saved and opened."""
    stage, seconds = task.progress.stage, task.seconds_left
    title = TITLES.get(stage, stage.capitalize())
    if stage in ALONE:
        return title
    left = "" if seconds is None else f", {clock(seconds)} left"
    return f"{title} {task.fraction:.0%}{left}"


@bpy.app.handlers.persistent
def _opened(*_: object) -> None:
    """Another file was opened: the old one's task must change nothing in it, but its images are saved."""
    if _current is not None:
        _current.job = dataclasses.replace(_current.job, finish=lambda _: None, notice=lambda _: False)


def register() -> None:
    """Show progress in the status bar; processes end with Blender."""
    bpy.types.STATUSBAR_HT_header.prepend(draw_status)
    atexit.register(cancel)


def unregister() -> None:
    """Stop what runs."""
    cancel()
    atexit.unregister(cancel)
    bpy.types.STATUSBAR_HT_header.remove(draw_status)


HANDLERS = (("load_post", _opened),)
