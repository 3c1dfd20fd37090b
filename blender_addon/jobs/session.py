"""What a button starts: one process that works for the panel, followed by a timer, shown in the status bar, stopped.

Both stages run outside this Blender. A render inside it could neither be stopped from Python (Cycles returns when its
image is done) nor let the artist edit the scene, and a crash would take the artist's work along. The price is a second
copy of the scene in memory and the seconds that it takes to open.
"""

import atexit
import collections
import contextlib
import dataclasses
import shutil
import tempfile
import textwrap
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.messages import LfsrError, Notice, Progress
from lfsr_core.base.records import to_data
from lfsr_core.base.system import remove_dead, system_errors, write_json
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import Request
from lfsr_core.process.child import Child, told_of

from ..scene.words import capitalized, clock, for_panel, sentence
from . import folders, images, runtime

SECONDS_BETWEEN_LOOKS = 0.1
SECONDS_TO_STOP = 1.5
LEAST_LEFT = 0.5  # seconds
STARTING = ("make", "reference", "plan", "estimate", "export", "show")  # tasks that start Blender
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
ALONE = ("save", "open", "first")  # stages that are shown without a percentage


@dataclasses.dataclass(frozen=True)
class Job:
    """A task of ``lfsr_core.tasks.runner``, and what follows it."""

    task: str
    arguments: Mapping[str, Any]  # records and JSON-ready data; a ``Request`` among them gets a copy of the open file
    finish: Callable[[dict[str, Any]], None]  # called with the task's result
    notice: Callable[[Notice], bool] = lambda _: False  # called with each; True if it need not be shown
    output: Path | None = None  # folder of the frame, or of the frames, that it renders
    frames: tuple[int, ...] = ()  # of an animation
    kept: Callable[[], str] = lambda: ""  # what to say of what is kept when it ends early


class Task:
    """A job under way; ``progress`` is what it told last."""

    def __init__(self, title: str, job: Job) -> None:
        """Announce that a copy of the file is saved; the first ``poll`` saves it and starts the process."""
        self.title, self.job, self.progress = title, job, Progress("save")
        self.notices: list[Notice] = []
        self.result: dict[str, Any] | None = None
        self.ended = False  # done, failed or cancelled
        self.child: Child | None = None
        self._started = self._heard = time.monotonic()
        self._shown = 0.0
        self._folder: Path | None = None
        self._copy: contextlib.AbstractContextManager[Path] | None = None
        self._reader: threading.Thread | None = None
        self._records: collections.deque[tuple[float, dict[str, Any]]] = collections.deque()

    @property
    def seconds(self) -> float:
        """Seconds since it was started."""
        return time.monotonic() - self._started

    @property
    def seconds_left(self) -> float | None:
        """Seconds left of the whole task; None while they cannot be told."""
        left = self.progress.left
        # One that is late by some seconds is expected to take as many more.
        return None if left is None else max(abs(left - (time.monotonic() - self._heard)), LEAST_LEFT)

    @property
    def fraction(self) -> float:
        """Fraction of the whole task that is done, 0 to 1: as its time goes, and at least what was told."""
        done, left, passed = self.progress.fraction, self.seconds_left, time.monotonic() - self._heard
        self._shown = min(1.0, max(self._shown, done if left is None else done + (1 - done) * passed / (passed + left)))
        return self._shown

    def poll(self) -> bool:
        """Take what the process has told; True once it is done. LfsrError if it failed."""
        if self.ended:
            return True
        try:
            if self.child is None:
                self._start()
                return False
            running = self._reader is not None and self._reader.is_alive()
            while self._records:
                self._take(*self._records.popleft())
            if running:
                return False
            if not self.child.is_done():
                raise self.child.crash(f"{self.title} stopped with", "try again, or save and report it")
        except BaseException:
            self.cancel()
            raise
        self.result = {name: value for name, value in self.child.last.items() if name != "stage"}
        self._end(None)
        return True

    def run(self) -> None:
        """Wait for the end, for scripts and background mode."""
        try:
            while not self.poll():
                if self._reader is not None:
                    self._reader.join(0.1)
        except BaseException:
            self.cancel()
            raise

    def cancel(self) -> None:
        """Stop the process and what it has started; finished parts and frames stay."""
        if self.child is not None:
            self.child.stop(SECONDS_TO_STOP)
            output, frames = self.job.output, self.job.frames
            targets = [FrameFolder.of_frame(output, number).path for number in frames] if output else []
            for target in targets if frames else filter(None, [output]):
                if target.parent.is_dir():
                    remove_dead(target)
        self._end(KeyboardInterrupt())

    def _start(self) -> None:
        self._folder = folder = Path(tempfile.mkdtemp(prefix="lfsr-", dir=bpy.app.tempdir or None))
        data = dict(self.job.arguments)
        if self.job.task in STARTING:
            data["command"] = runtime.render_command()
        if requests := {name: value for name, value in data.items() if isinstance(value, Request)}:
            self._copy = runtime.file_copy(self.job.output)
            scene = str(self._copy.__enter__())
            data |= {name: dataclasses.replace(request, scene=scene) for name, request in requests.items()}
        task, temporary = folder / "task.json", folder / "temporary"
        temporary.mkdir()
        write_json(task, {"task": self.job.task, **to_data(data)})
        command = runtime.second_stage_command("-m", runtime.RUNNER, str(task))
        # What a process that is killed leaves goes with the folder.
        environment = runtime.environment() | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(temporary))
        self.child = Child(command, environment, low_priority=True)
        self.progress = Progress("open") if requests else Progress(self.job.task)
        records = ((time.monotonic(), record) for record in self.child.records())
        self._reader = threading.Thread(target=self._records.extend, args=(records,), daemon=True)
        self._reader.start()

    def _take(self, heard: float, record: dict[str, Any]) -> None:
        told = told_of(record)
        if isinstance(told, Notice):
            if not self.job.notice(told) and told not in self.notices:
                self.notices.append(told)
        elif told is not None:
            if told.left != self.progress.left:  # else it is a repetition, and the time counts down from the first
                self._heard = heard
            self.progress = told

    def _end(self, error: BaseException | None) -> None:
        """Tidy up; the copy stays after an ``error``, if the render has left parts."""
        self.ended = True
        if self._copy is not None:
            copy, self._copy = self._copy, None
            with contextlib.suppress(KeyboardInterrupt):
                copy.__exit__(type(error) if error else None, error, None)
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)


_current: Task | None = None


def current() -> Task | None:
    """The task that runs now, None if there is none."""
    return _current


def check_idle() -> None:
    """LfsrError if something renders already, here or in Blender itself; makes Blender's temporary folder."""
    if _current is not None:
        raise LfsrError(f"{_current.title} is still running: wait for it or cancel it")
    if bpy.app.is_job_running("RENDER"):
        raise LfsrError("Blender is rendering: wait for it or cancel it")
    Path(bpy.app.tempdir).mkdir(parents=True, exist_ok=True)  # programs that tidy the system's remove it


def start(title: str, job: Job) -> Task:
    """Follow ``job`` from a timer and call its ``finish`` with the result."""
    global _current
    check_idle()
    _current, state = Task(title, job), bpy.context.window_manager.lfsr
    state.message = state.outcome = state.outcome_folder = ""
    # Persistent: opening another file must not orphan the process.
    bpy.app.timers.register(_look, first_interval=SECONDS_BETWEEN_LOOKS, persistent=True)
    redraw()  # the panel tells what Blender does next before Blender is busy with it
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
        _saved()
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
            _saved()
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
def _saved(*_: object) -> None:
    """Move what was rendered before the file was saved beside it, once no task works on it."""
    if _current is None:
        folders.keep_saved()


@bpy.app.handlers.persistent
def _opened(*_: object) -> None:
    """Another file was opened: the old one's task must change nothing in it, but its images are saved."""
    state = bpy.context.window_manager.lfsr  # stays with Load UI off
    state.message = state.outcome = state.outcome_folder = state.plan_scene = state.probe_scene = ""
    if _current is not None:
        _current.notices.clear()
        _current.job = dataclasses.replace(_current.job, finish=lambda _: setattr(
            bpy.context.window_manager.lfsr, "outcome", ""), notice=lambda _: True, kept=lambda: "")


def register() -> None:
    """Show progress in the status bar; processes end with Blender."""
    bpy.types.STATUSBAR_HT_header.prepend(draw_status)
    atexit.register(cancel)


def unregister() -> None:
    """Stop what runs."""
    cancel()
    atexit.unregister(cancel)
    bpy.types.STATUSBAR_HT_header.remove(draw_status)


HANDLERS = (("load_post", _opened), ("save_post", _saved))
