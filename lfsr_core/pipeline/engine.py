"""Render an animation: Blender stays open over several frames, and frames are finished while the next ones render."""

from __future__ import annotations

import collections
import dataclasses
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import Progress, duration, silent
from lfsr_core.frames.frame import read_part
from lfsr_core.frames.report import read_report
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.animation import DONE, TO_RENDER, Animation, SecondStage, beside, state
from lfsr_core.pipeline.finishing import finish_frame
from lfsr_core.pipeline.rendering import Listener, Warn, run_jobs
from lfsr_core.pipeline.staging import remove_dead
from lfsr_core.process.blender import Starts, find_blender
from lfsr_core.process.child import CrashError

CHUNK = 16  # frames of one Blender
TRIES = 2  # of a frame at which Blender crashes
MADE, KEPT, FAILED = "made", "kept", "failed"


@dataclasses.dataclass(frozen=True)
class Result:
    """The outcome of a frame."""

    frame: int
    folder: str
    state: str  # MADE, KEPT or FAILED
    error: str = ""  # the sentence, where it failed
    # seconds of the render and of all that follows it, 0 where it failed
    render: float = 0.0
    finish: float = 0.0


@dataclasses.dataclass(frozen=True)
class Tools:
    """What an animation is rendered with, and who is told."""

    blender: str | Starts | None = None  # executable, None for the best there is, or what knows how to start Blender
    progress: Progress = silent  # called with (stage, fraction, message)
    warn: Warn = lambda sentence: None
    chunk: int = CHUNK
    overwrite: bool = False  # whether to render finished frames again
    tells_left: bool = True  # whether its progress says how much time is left


class _CancelledError(Exception):
    """The second stage is to stop."""


def render_animation(animation: Animation, tools: Tools) -> list[Result]:
    """Render and finish every frame that is not done, and return the outcome of each frame.

    A frame at which Blender crashes twice, or which cannot be finished, is left out; the others continue. LfsrError
    with Blender's own sentence after bad input, or where a folder holds another render; KeyboardInterrupt once Blender
    is stopped: at most the frames in work are lost.
    """
    run = _Run(animation, tools)
    try:
        for job in animation.jobs:
            run.take(job)
        run.finish_ready()
        run.render()
        run.finishing.wait(run.tell)
    finally:
        run.finishing.stop()
    return [run.result(job) for job in animation.jobs]


class _Run:
    """One run over an animation."""

    def __init__(self, animation: Animation, tools: Tools) -> None:
        self.animation, self.tools = animation, tools
        self.waiting: list[Request] = []
        self.rendered: list[Request] = []  # that wait for neighbouring frames
        self.kept: set[str] = set()
        self.failed: dict[str, str] = {}
        self.finishing = _Finishing(animation.second)
        self.count, self.since = 0, 0.0  # frames to render, and the time when rendering began

    def take(self, job: Request) -> None:
        """Decide what is to be done for a frame."""
        found = TO_RENDER if self.tools.overwrite else state(self.animation, job)
        if found == TO_RENDER:
            self.waiting.append(job)
            return
        remove_dead(Path(job.output))
        if found == DONE:
            self.kept.add(job.output)
        else:
            self.rendered.append(job)

    def finish_ready(self) -> None:
        """Finish the rendered frames whose neighbours are rendered."""
        missing = {job.output for job in self.waiting}
        for job in list(self.rendered):
            if missing.isdisjoint(beside(self.animation, job)):
                self.rendered.remove(job)
                self.finishing.add(job)

    def render(self) -> None:
        """Render the waiting frames, chunk by chunk."""
        if not self.waiting:
            return
        given, crashes = self.tools.blender, collections.Counter[str]()
        blender = find_blender(given) if given is None or isinstance(given, str) else given
        self.count, self.since = len(self.waiting), time.monotonic()
        listener = Listener(self._progress, self.tools.warn, self._rendered)
        while self.waiting:
            try:
                run_jobs(self.waiting[:self.tools.chunk], blender, listener)
            except CrashError as error:
                current = self.waiting[0]
                crashes[current.output] += 1
                if crashes[current.output] >= TRIES:
                    self.failed[self.waiting.pop(0).output] = str(error)
                    self.finish_ready()
                    self.tools.warn(f"frame {current.frame} is left out: {error}")

    def tell(self, message: str, fraction: float = 0.0) -> None:
        """Show how much of what is to be rendered is done; ``fraction``: of the frame in work."""
        done = self.count - len(self.waiting) + (fraction if self.waiting else 0.0)
        self.tools.progress("frames", done / self.count if self.count else 1.0, message)

    def result(self, job: Request) -> Result:
        """Return the outcome of a frame."""
        number, sentence = job.frame or 0, self.failed.get(job.output) or self.finishing.failed.get(job.output)
        if sentence:
            return Result(number, job.output, FAILED, sentence)
        seconds = read_report(job.output).seconds
        finish = sum(value for stage, value in seconds.items() if stage != "render")
        return Result(number, job.output, KEPT if job.output in self.kept else MADE,
                      render=read_part(job.output).seconds.get("render", 0.0), finish=finish)

    def _rendered(self, job: Request) -> None:
        self.waiting.remove(job)
        self.rendered.append(job)
        self.finish_ready()

    def _progress(self, stage: str, fraction: float, message: str) -> None:
        if self.waiting and stage == "render":
            rendered = self.count - len(self.waiting)
            told, done = f"frame {self.waiting[0].frame}, {rendered + 1} of {self.count}", rendered + fraction
            if done >= 0.05 and self.tools.tells_left:
                seconds = (time.monotonic() - self.since) / done * (self.count - done)
                told += f", {duration(seconds)} left"
            self.tell(told, fraction)


class _Finishing:
    """The second stage of one frame after the other, beside Blender; waiting frames are on disk, not in memory."""

    def __init__(self, second: SecondStage) -> None:
        self.second, self.failed = second, dict[str, str]()
        self._thread = ThreadPoolExecutor(1, "lfsr-finish")
        self._work: list[tuple[Request, Future[None]]] = []
        self._stopped = threading.Event()

    def add(self, job: Request) -> None:
        """Finish the rendered frame of ``job`` after those before it."""
        self._work.append((job, self._thread.submit(self._finish, job)))

    def wait(self, told: Callable[[str], None]) -> None:
        """Wait until all are finished; errors become sentences in ``failed``."""
        for job, work in self._work:
            if not work.done() or work is self._work[-1][1]:  # progress ends at 1, however quick the last frame was
                told(f"finishing frame {job.frame}")
            try:
                work.result()
            except LfsrError as error:
                self.failed[job.output] = str(error)

    def stop(self) -> None:
        """Stop at the next step of the frame in work."""
        self._stopped.set()
        self._thread.shutdown(wait=True, cancel_futures=True)

    def _finish(self, job: Request) -> None:
        finish_frame(Path(job.output), self.second.finish, self._check_stopped, step=self.second.step)

    def _check_stopped(self, *_: object) -> None:
        if self._stopped.is_set():
            raise _CancelledError


def table(results: Sequence[Result]) -> str:
    """Return a line per frame, below a line of titles."""
    return "\n".join([f"{'frame':>7}  {'state':6}  {'render':>9}  {'finish':>9}", *map(_line, results)])


def counts(results: Sequence[Result], seconds: float) -> str:
    """Return how many frames are in which state after ``seconds``."""
    found = [f"{sum(result.state == state for result in results)} {state}" for state in (MADE, KEPT, FAILED)]
    return f"{len(results)} frames: {', '.join(found)}, in {duration(seconds)}"


def _line(result: Result) -> str:
    start = f"{result.frame:7}  {result.state:6}"
    if result.state == FAILED:
        return f"{start}  {result.error}"
    return f"{start}  {result.render:7.1f} s  {result.finish:7.1f} s"
