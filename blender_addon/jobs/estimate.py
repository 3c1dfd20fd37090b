"""How long a step will take: from the progress that its process reports, or from steps of its kind before it."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.frames.request import Request
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.panel_rays import rendered_size

LEAST_LEFT = 0.5  # seconds
# Seconds of the second stage on two cores: its start, per million finished pixels, and per million rendered ones.
START, PER_FINISHED, PER_RENDERED, PER_DENOISED = 1.2, 0.07, 0.05, 0.5
# Cycles renders its samples in batches, each larger than the one before. Per sample, what follows takes this part of
# the first batch, and of the last one.
FIRST_PACE, PACE = 0.8, 0.9
# Cycles reports its first sample early and the next ones rarely: a speed of the same scene before counts as if so much
# of the work had been done at it.
TRUST = 0.15
# Other programs take and leave cores meanwhile, but a sample takes the same CPU seconds. So the work is counted in
# these, at the rate of the last BEATS reports, unless the process rests, as one that waits for a GPU.
BEATS, LEAST_RATE = 6, 0.1
_speeds: dict[tuple[str, str | None], float] = {}  # seconds per path sample of scenes, in this session
_slower: dict[str, float] = {}  # seconds that steps took as multiples of those expected, in this session


@dataclasses.dataclass(frozen=True)
class Moment:
    """What was done of a step at a time."""

    time: float  # seconds, of a clock that only runs forward
    done: float  # fraction, 0 to 1
    cpu: float | None = None  # seconds of all its process's threads


class StepClock:
    """Follows one step; every ``now`` is of the same clock."""

    def __init__(self, now: float, expected: float | None = None, before: float | None = None,
                 is_render: bool = False) -> None:
        """``expected``: seconds that the step will take, None where only its progress tells.

        ``before``: seconds that the work itself would take at the speed of an earlier step, None where there was none.
        ``is_render``: whether Cycles renders one image.
        """
        self.started, self.expected, self.before = now, expected, before
        self._first_pace, self._pace = (FIRST_PACE, PACE) if is_render else (1.0, 1.0)
        # When the work itself began, after scenes were opened and prepared, and all that was heard of it since.
        self._heard: list[Moment] = []
        self._beats: list[Moment] = []

    def take(self, now: float, done: float, cpu: float | None = None) -> None:
        """Note new progress, and the CPU seconds of the process if they are known."""
        self.beat(now, cpu)
        moment = Moment(now, done, cpu)
        if not self._heard or done <= self._heard[0].done:
            self._heard = [moment]
        elif done > self._heard[-1].done:
            self._heard.append(moment)

    def beat(self, now: float, cpu: float | None) -> None:
        """Note that the process works on."""
        if cpu is not None:
            self._beats = [*self._beats[1 - BEATS:], Moment(now, 0.0, cpu)]

    def left(self, now: float) -> float | None:
        """Seconds left, None while they cannot be told."""
        if self.expected is not None:
            left = self.started + self.expected - now
        elif (pace := self._seconds_of_all()) is not None:
            left = pace * (1 - self._heard[-1].done) - self._work(self._heard[-1], Moment(now, 0.0))
        else:
            return None
        # A step that is late by some seconds is expected to take as many more.
        return max(abs(left), LEAST_LEFT)

    def worked(self, now: float) -> float | None:
        """Seconds since the work itself began, None where an earlier run has done some of it."""
        return now - self._heard[0].time if self._heard and not self._heard[0].done else None

    def share(self, now: float) -> float:
        """Fraction of the step that is done by now, as its time goes, and at least what was reported."""
        left, reported = self.left(now), self._heard[-1].done if self._heard else 0.0
        begun = self._heard[0] if self._heard and self.expected is None else Moment(self.started, 0.0)
        passed = now - begun.time
        if left is None or passed <= 0:
            return reported
        return max(reported, begun.done + (1 - begun.done) * passed / (passed + left))

    def _seconds_of_all(self) -> float | None:
        """Seconds that all of the work would take at the pace of what is left."""
        if len(self._heard) < 2:
            return self.before if self._heard else None
        first, last = self._heard[0], self._heard[-1]
        half = (first.done + last.done) / 2
        since = next(moment for moment in reversed(self._heard) if moment.done <= half)
        pace = self._pace if len(self._heard) > 2 else self._first_pace
        seen = pace * self._work(since, last) / (last.done - since.done)
        known = last.done - first.done
        return seen if self.before is None else (known * seen + TRUST * self.before) / (known + TRUST)

    def _work(self, since: Moment, until: Moment) -> float:
        """Work between two moments, in seconds of the rate at which the process works now."""
        rate = self._rate()
        if rate < LEAST_RATE or since.cpu is None:
            return until.time - since.time
        last = self._beats[-1]
        assert last.cpu is not None
        cpu = last.cpu + rate * (until.time - last.time) if until.cpu is None else until.cpu
        return (cpu - since.cpu) / rate

    def _rate(self) -> float:
        """CPU seconds per second of late, 0 where they are not known."""
        if len(self._beats) < 2:
            return 0.0
        first, last = self._beats[0], self._beats[-1]
        assert first.cpu is not None and last.cpu is not None
        return (last.cpu - first.cpu) / max(last.time - first.time, 1e-3)


def expected(stage: str, seconds: float) -> float:
    """Seconds that a step of this ``stage`` will take, if one on another machine takes ``seconds``."""
    return seconds * _slower.get(stage, 1.0)


def learn(stage: str, seconds: float, took: float) -> None:
    """Note how long a step took for which ``seconds`` were expected."""
    if seconds > 0 and took > 0:
        _slower[stage] = _slower.get(stage, 1.0) * took / seconds


def sampling(job: Request) -> float | None:
    """Seconds of the path samples of ``job`` at the speed at which its scene was rendered before, if it was."""
    speed = _speeds.get((job.source, job.scene_name))
    return None if speed is None else speed * paths(job)


def learn_sampling(job: Request, seconds: float) -> None:
    """Note how long the samples of ``job`` took."""
    _speeds[job.source, job.scene_name] = seconds / paths(job)


def forget_speeds() -> None:
    """Forget the speeds of all scenes: files in two folders can have one name."""
    _speeds.clear()


def paths(job: Request) -> float:
    """Path samples of the whole image of ``job``, whatever scale it chooses."""
    return (finished_pixels(job.display, job.layout == SUBPIXELS)
            * (job.sampling.rays or job.sampling.samples / job.display.finished_pixels(job.sampling.scale)))


def finished_pixels(display: DisplayProfile, is_direct: bool) -> int:
    """Pixels of the finished EIA, or with ``is_direct`` the panel's subpixels."""
    return math.prod(rendered_size(display) if is_direct else display.eia_pixels)


def second_stage(display: DisplayProfile, scale: int, method: str, is_direct: bool = False) -> float:
    """Seconds of the second stage of a frame, on a usual machine."""
    finished = finished_pixels(display, is_direct) / 1e6
    rendered = finished / display.finished_pixels(scale)
    denoises = method.startswith(("denoise", "oidn"))
    return START + PER_FINISHED * finished + (PER_DENOISED if denoises else PER_RENDERED) * rendered
