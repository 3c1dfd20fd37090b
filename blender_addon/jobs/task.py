"""What a button starts: one process that works for the panel, followed without waiting, stopped.

Both stages run outside this Blender. A render inside it could neither be stopped from Python (Cycles returns when its
image is done) nor let the artist edit the scene, and a crash would take the artist's work along. The price is a second
copy of the scene in memory and the seconds that it takes to open.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import write_json
from lfsr_core.base.notices import Notice, Progress
from lfsr_core.base.records import to_data
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.staging import remove_dead
from lfsr_core.process.child import Child
from lfsr_core.process.protocol import told_of

from . import runtime
from .copy import file_copy

SECONDS_TO_STOP = 1.5
LEAST_LEFT = 0.5  # seconds
SAVE = Progress("save")
STARTING = ("make", "reference", "plan", "estimate", "export", "show")  # tasks that start Blender


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
        self.title, self.job, self.progress = title, job, SAVE
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
        share = done if left is None else done + (1 - done) * passed / (passed + left)
        self._shown = min(1.0, max(self._shown, share))
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

    def run(self) -> dict[str, Any]:
        """Wait for the end and return the result, for scripts and background mode."""
        try:
            while not self.poll():
                if self._reader is not None:
                    self._reader.join(0.1)
        except BaseException:
            self.cancel()
            raise
        return self.result or {}

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
            self._copy = file_copy(self.job.output)
            scene = str(self._copy.__enter__())
            data |= {name: dataclasses.replace(request, scene=scene) for name, request in requests.items()}
        task, temporary = folder / "task.json", folder / "temporary"
        temporary.mkdir()
        write_json(task, {"task": self.job.task, **to_data(data)})
        command = [*runtime.second_stage_command(runtime.RUNNER), str(task)]
        # What a process that is killed leaves goes with the folder.
        environment = runtime.environment() | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(temporary))
        try:
            self.child = Child(command, environment, low_priority=True)
        except OSError as error:
            raise LfsrError(f"{self.title} cannot start {command[0]!r} ({error.strerror}): check the add-on's "
                            "preferences") from None
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
            if told.left != self.progress.left:  # else it was said again, and counts down since
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
