"""Renders a shot: Blender stays open over several frames, and one frame is finished while the next one renders."""

from __future__ import annotations

import collections
import dataclasses
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import read_part
from lfsr_core.frames.job import Job
from lfsr_core.frames.report import read_report
from lfsr_core.progress import Progress, silent
from lfsr_core.reconstruct.second_stage import upscale_frame
from lfsr_core.render.blender import Starts, find_blender
from lfsr_core.render.child import CrashError
from lfsr_core.render.process import Listener, Warn, run_jobs
from lfsr_core.render.staging import remove_dead
from lfsr_core.sequence.shot import DONE, TO_RENDER, SecondStage, Shot, beside, state

CHUNK = 16  # frames of one Blender
TRIES = 2  # of a frame at which Blender crashes
MADE, KEPT, FAILED = "made", "kept", "failed"


@dataclasses.dataclass(frozen=True)
class Result:
    """What became of a frame."""

    frame: int
    folder: str
    state: str  # MADE, KEPT or FAILED
    error: str = ""  # the sentence, where it failed
    # seconds of the render and of all that follows it, 0 where it failed
    render: float = 0.0
    finish: float = 0.0


@dataclasses.dataclass(frozen=True)
class Tools:
    """What a shot is rendered with, and who is told."""

    # executable, None for the best there is, or what has Blender's command lines
    blender: str | Starts | None = None
    progress: Progress = silent  # called with (stage, fraction, message)
    warn: Warn = lambda sentence: None
    chunk: int = CHUNK
    overwrite: bool = False  # frames that are done are made again


class _CancelledError(Exception):
    """The second stage is to stop."""


def render_shot(shot: Shot, tools: Tools) -> list[Result]:
    """Render and finish every frame of ``shot`` that is not done; what became of each, in their order.

    A frame at which Blender crashes twice, or which cannot be finished, is left out; the others go on.

    Raises
    ------
    LfsrError : with Blender's own sentence after bad input, or where a folder holds another render
    KeyboardInterrupt : once Blender is stopped; at most the frames in work are lost
    """
    run = _Run(shot, tools)
    try:
        for job in shot.jobs:
            run.take(job)
        run.finish_ready()
        run.render()
        run.finishing.wait(run.told)
    finally:
        run.finishing.stop()
    return [run.result(job) for job in shot.jobs]


class _Run:
    """One run over a shot."""

    def __init__(self, shot: Shot, tools: Tools) -> None:
        self.shot, self.tools = shot, tools
        self.waiting: list[Job] = []
        self.rendered: list[Job] = []  # that wait for frames beside them
        self.kept: set[str] = set()
        self.failed: dict[str, str] = {}
        self.finishing = _Finishing(shot.second)
        self.clock = _Clock()

    def take(self, job: Job) -> None:
        """Decide what is to be done for a frame."""
        found = TO_RENDER if self.tools.overwrite else state(self.shot, job)
        if found == TO_RENDER:
            self.waiting.append(job)
            return
        remove_dead(Path(job.output))
        if found == DONE:
            self.kept.add(job.output)
        else:
            self.rendered.append(job)

    def finish_ready(self) -> None:
        """Finish the rendered frames beside which nothing is still to be rendered."""
        missing = {job.output for job in self.waiting}
        for job in list(self.rendered):
            if missing.isdisjoint(beside(self.shot, job)):
                self.rendered.remove(job)
                self.finishing.add(job)

    def render(self) -> None:
        """Render what waits, chunk by chunk."""
        if not self.waiting:
            return
        blender, crashes = self._blender(), collections.Counter[str]()
        self.clock.start(len(self.waiting))
        listener = Listener(self._progress, self.tools.warn, self._rendered)
        while self.waiting:
            try:
                run_jobs(self.waiting[:self.tools.chunk], blender, listener)
            except CrashError as error:
                current = self.waiting[0]
                crashes[current.output] += 1
                if crashes[current.output] >= TRIES:
                    self._leave_out(self.waiting.pop(0), str(error))

    def _blender(self) -> Starts:
        given = self.tools.blender
        return find_blender(given) if given is None or isinstance(given, str) else given

    def _leave_out(self, job: Job, sentence: str) -> None:
        self.failed[job.output] = sentence
        self.finish_ready()
        self.tools.warn(f"frame {job.frame} is left out: {sentence}")

    def _rendered(self, job: Job) -> None:
        self.waiting.remove(job)
        self.clock.one_done()
        self.rendered.append(job)
        self.finish_ready()

    def _progress(self, stage: str, fraction: float, message: str) -> None:
        if self.waiting and stage == "render":
            self.told(f"frame {self.waiting[0].frame}, {self.clock.left(fraction)}", fraction)

    def told(self, message: str, fraction: float = 0.0) -> None:
        """Show how much is done of what this run renders."""
        done = self.clock.count - len(self.waiting) + (fraction if self.waiting else 0.0)
        self.tools.progress("frames", done / self.clock.count if self.clock.count else 1.0, message)

    def result(self, job: Job) -> Result:
        """What became of a frame."""
        sentence = self.failed.get(job.output) or self.finishing.failed.get(job.output)
        if sentence:
            return Result(job.frame, job.output, FAILED, sentence)
        seconds = read_report(job.output).seconds
        finish = sum(value for stage, value in seconds.items() if stage != "render")
        return Result(job.frame, job.output, KEPT if job.output in self.kept else MADE,
                      render=read_part(job.output).seconds.get("render", 0.0), finish=finish)


class _Clock:
    """How long the frames that wait will take, going by those that were rendered in this run."""

    def __init__(self) -> None:
        self.count = self.done = 0
        self.since = time.monotonic()

    def start(self, count: int) -> None:
        """``count`` frames wait from now on."""
        self.count, self.since = count, time.monotonic()

    def one_done(self) -> None:
        """One of them is rendered."""
        self.done += 1

    def left(self, fraction: float) -> str:
        """In words; ``fraction``: of the frame in work."""
        done = self.done + fraction
        if done < 0.05:
            return f"{self.done + 1} of {self.count}"
        seconds = (time.monotonic() - self.since) / done * (self.count - done)
        return f"{self.done + 1} of {self.count}, {duration(seconds)} left"


class _Finishing:
    """The second stage of one frame after the other, beside Blender; what waits lies on the disk, not in memory."""

    def __init__(self, second: SecondStage) -> None:
        self.second, self.failed = second, dict[str, str]()
        self._thread = ThreadPoolExecutor(1, "lfsr-finish")
        self._work: list[tuple[Job, Future[Any]]] = []
        self._stopped = threading.Event()

    def add(self, job: Job) -> None:
        """Finish the rendered frame of ``job`` when those before it are."""
        self._work.append((job, self._thread.submit(self._finish, job)))

    def _finish(self, job: Job) -> None:
        options = dataclasses.replace(self.second.options, progress=self._look)
        upscale_frame(Path(job.output), self.second.method, options)

    def _look(self, *_: object) -> None:
        if self._stopped.is_set():
            raise _CancelledError

    def wait(self, told: Callable[[str], None]) -> None:
        """Until all are finished; errors become sentences in ``failed``."""
        for job, work in self._work:
            if not work.done():
                told(f"finishing frame {job.frame}")
            try:
                work.result()
            except LfsrError as error:
                self.failed[job.output] = str(error)

    def stop(self) -> None:
        """End at the next step of the frame in work."""
        self._stopped.set()
        self._thread.shutdown(wait=True, cancel_futures=True)


def duration(seconds: float) -> str:
    """In the two largest of hours, minutes and seconds."""
    whole = round(seconds)
    if whole >= 3600:
        return f"{whole // 3600} h {whole % 3600 // 60} min"
    return f"{whole // 60} min {whole % 60} s" if whole >= 60 else f"{whole} s"
