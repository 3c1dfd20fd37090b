"""What a button starts: a task of steps, each a worker process, one after the other.

A task is a generator of steps; whatever ends it early (an error, a cancel) runs
its ``finally`` blocks, so that temporary files never stay. ``poll`` never waits.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import to_data
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.staging import has_parts

from ..scene.array.scale import CHOOSE, LOOK
from . import estimate, runtime
from .worker import Worker

PANEL_TASKS = "lfsr_core.tasks.runner"
CONTINUE = "Render again to continue"
OPENING = "Opening the scene"  # instead of its temporary path


@dataclasses.dataclass(frozen=True)
class Step:
    """One worker process, or the announcement that Blender itself is busy next, without a command."""

    stage: str  # what the panel shows meanwhile
    fraction: float  # of the whole task's time, 0 to 1
    worker: str  # the process in error messages, as "The render"
    command: list[str]
    parts: Path | None = None  # folder in which it caches parts of a long render
    seconds: float | None = None  # that it takes on a usual machine, None where only its progress tells
    after: float = 0.0  # seconds of the steps after it
    job: Request | None = None  # that it renders with all its lenses
    message: str = ""  # what is shown until it reports
    resumes: bool = False  # whether the same step continues where it was stopped, also without parts


Steps = Generator[Step, dict[str, Any], Any]
# Yielded before ``file_copy``: the panel says what Blender is busy with before it stops to answer.
SAVING = Step("Saving", 0.0, "", [], message="Saving a copy of the file")
ALONE = (OPENING, SAVING.message)  # messages that say more than their stages


class Task:
    """Steps under way; ``stage``, ``fraction`` and ``message`` are the progress."""

    def __init__(self, title: str, steps: Steps) -> None:
        """Start the first step; LfsrError where it cannot be started."""
        self.title, self.stage, self.message = title, "", ""
        self.warnings: list[str] = []
        self.result: Any = None
        self.worker: Worker | None = None
        self.ended = False  # done, failed or cancelled
        self._steps, self._started = steps, time.monotonic()
        self._before = self._shown = 0.0
        self._clock = estimate.StepClock(self._started)
        self._step: Step | None = None
        self._parts: Path | None = None  # of the last render
        self._advance(None)

    @property
    def fraction(self) -> float:
        """Fraction of the whole task that is done, 0 to 1; it never falls."""
        share = self._step.fraction * self._clock.share(time.monotonic()) if self._step else 0.0
        self._shown = min(1.0, max(self._shown, self._before + share))
        return self._shown

    @property
    def seconds_left(self) -> float | None:
        """Seconds left of the whole task; None while they cannot be told."""
        left = self._clock.left(time.monotonic())
        return None if left is None or self._step is None else left + self._step.after

    @property
    def seconds(self) -> float:
        """Seconds since it was started."""
        return time.monotonic() - self._started

    @property
    def kept(self) -> str:
        """What to do about a render that ended early; empty where nothing of it is cached."""
        return CONTINUE if self._parts and has_parts(self._parts) else ""

    @property
    def cancelled(self) -> str:
        """What to say once it is cancelled."""
        resumes = self._step is not None and self._step.resumes
        return f"Cancelled. {CONTINUE}" if resumes or self.kept else "Cancelled"

    def poll(self) -> bool:
        """Look at the worker and start the next when it is done; True when all are. LfsrError if one failed."""
        if self.ended:
            return True
        running = self.worker is not None and self.worker.running()
        for record in self.worker.records() if self.worker else ():
            self._take(record)
        if running:
            return False
        try:
            self._advance(self._result(self.worker) if self.worker else {})
        except BaseException:
            self.cancel()
            raise
        return self.ended

    def _result(self, worker: Worker) -> dict[str, Any]:
        """What ``worker`` returned; an error goes through the steps, which may keep what is done."""
        try:
            return worker.check()
        except LfsrError as error:
            self._steps.throw(error)
            raise

    def cancel(self) -> None:
        """Stop the worker and tidy up after all steps."""
        if self.worker is not None:
            self.worker.stop()
            self.worker = None
        self.ended = True
        self._steps.close()

    def run(self) -> Any:
        """Wait for the end and return the result, for scripts and background mode."""
        try:
            while not self.poll():
                if self.worker is not None:
                    self.worker.wait(0.1)
        except BaseException:
            self.cancel()
            raise
        return self.result

    def _take(self, record: dict[str, Any]) -> None:
        if record.get("warning"):
            self.warnings.append(str(record.get("message", "")))
        elif "fraction" in record:
            is_open = record.get("stage") == "open"
            self.message = OPENING if is_open else str(record.get("message", ""))
            heard, cpu = record.get("heard", time.monotonic()), record.get("cpu")
            if record.get("repeated"):
                self._clock.beat(heard, cpu)
            elif not is_open:
                self._clock.take(heard, min(1.0, float(record["fraction"])), cpu)

    def _advance(self, record: dict[str, Any] | None) -> None:
        if self._step is not None:
            self._before += self._step.fraction
            self._learn(self._step)
        try:
            self._step = next(self._steps) if record is None else self._steps.send(record)
        except StopIteration as end:
            self._step, self.worker, self.result, self.ended = None, None, end.value, True
            return
        self.message, self.stage = self._step.message, self._step.stage
        seconds = self._step.seconds
        self._clock = estimate.StepClock(
            time.monotonic(), seconds if seconds is None else estimate.expected(self.stage, seconds),
            estimate.sampling(self._step.job) if self._step.job else None, self._step.job is not None)
        self._parts = self._step.parts or self._parts
        self.worker = Worker(self._step.worker, self._step.command) if self._step.command else None


    def _learn(self, step: Step) -> None:
        """Note how long a step has taken, for the next of its kind."""
        now = time.monotonic()
        if step.seconds is not None:
            estimate.learn(step.stage, self._clock.expected or 0.0, now - self._clock.started)
        worked = self._clock.worked(now)
        if step.job is not None and worked is not None:
            estimate.learn_sampling(step.job, worked)


def render_step(job: Request, folder: Path, fraction: float, stage: str, after: float = 0.0) -> Step:
    """Render ``job`` in a background Blender; the job file goes into ``folder``. Else as of ``Step``."""
    path = write_job(job, folder / "job.json")
    return Step(stage, fraction, "The render", _render_command(path), Path(job.parts) if job.parts else None,
                after=after, message=OPENING, job=None if job.lens_list else job)


def write_job(job: Request, path: Path) -> Path:
    """Write ``job`` for a background Blender into the file ``path``, and return that."""
    return _write(path, to_data(job))


def scale_step(job: Request, folder: Path, fraction: float) -> Step:
    """Choose one of the scales of ``job`` in a background Blender; its "scale" and "reason" are sent into the steps."""
    path = _write(folder / "scale.json", to_data(job))
    return Step("Looking at the depth", fraction, "The choice of a scale",
                [*_render_command(Path(CHOOSE)), str(path)], message=OPENING)


def depth_step(job: Request, folder: Path, fraction: float) -> Step:
    """Look at the subject's depth in a background Blender; its disparities are sent into the steps as "moves"."""
    path = _write(folder / "depth.json", to_data(job))
    return Step("Looking at the depth", fraction, "The look at the depth",
                [*_render_command(Path(LOOK)), str(path)], message=OPENING)


def second_stage_step(stage: str, fraction: float, work: Path, task: str, /, **arguments: Any) -> Step:
    """Run ``task`` of ``lfsr_core.tasks.runner``; its result is sent into the generator of steps.

    The task's file goes into the folder ``work``; ``arguments`` are those of the task, JSON-ready.
    """
    path = _write(work / f"{task}.json", {"task": task, **arguments})
    return Step(stage, fraction, "The second stage", [*runtime.second_stage_command(PANEL_TASKS), str(path)])


def rendering_step(stage: str, fraction: float, work: Path, task: str, /, **arguments: Any) -> Step:
    """Run a task that starts renders itself: a ``second_stage_step`` with the ``command`` for renders."""
    step = second_stage_step(stage, fraction, work, task, **arguments, command=_render_command(Path())[:-1])
    return dataclasses.replace(step, message=OPENING)


def _render_command(job_file: Path) -> list[str]:
    command = runtime.render_command(job_file)
    if bpy.app.binary_path and runtime.may_run_scripts(bpy.data.filepath):
        command.insert(1, "--enable-autoexec")
    return command


def _write(path: Path, data: dict[str, Any]) -> Path:
    path.write_text(json.dumps(data), encoding="utf-8")
    return path
