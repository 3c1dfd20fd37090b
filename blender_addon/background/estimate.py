"""How long a step will take: from the progress that its process reports, or from steps of its kind before it."""

from __future__ import annotations

import dataclasses

from lfsr_core.optics.display import DisplayProfile

LEAST_LEFT = 0.5  # seconds
# Seconds of the second stage on two cores: its start, per million finished pixels, and per million rendered ones.
START, PER_FINISHED, PER_RENDERED, PER_DENOISED = 0.8, 0.07, 0.05, 0.5
_slower: dict[str, float] = {}  # seconds that steps took as multiples of those expected, in this session


@dataclasses.dataclass(frozen=True)
class Moment:
    """What was done of a step at a time."""

    time: float  # seconds, of a clock that only runs forward
    done: float  # fraction, 0 to 1


class StepClock:
    """Follows one step; every ``now`` is of the same clock."""

    def __init__(self, now: float, expected: float | None = None) -> None:
        """``expected``: seconds that the step will take, None where only its progress tells."""
        self.started, self.expected = now, expected
        # When the work itself began, after scenes were opened and prepared, and when it was last heard of.
        self._first: Moment | None = None
        self._last: Moment | None = None

    def take(self, now: float, done: float) -> None:
        """Note new progress."""
        if self._first is None or self._last is None or done <= self._first.done:
            self._first = self._last = Moment(now, done)
        elif done > self._last.done:
            self._last = Moment(now, done)

    def left(self, now: float) -> float | None:
        """Seconds left, None while they cannot be told."""
        total, begun = self._work()
        # A step that is late by some seconds is expected to take as many more.
        return None if total is None else max(abs(total - (now - begun.time)), LEAST_LEFT)

    def share(self, now: float) -> float:
        """Fraction of the step that is done by now, as its time goes, and at least what was reported."""
        left, reported = self.left(now), self._last.done if self._last else 0.0
        begun = self._work()[1]
        passed = now - begun.time
        if left is None or passed <= 0:
            return reported
        return max(reported, begun.done + (1 - begun.done) * passed / (passed + left))

    def _work(self) -> tuple[float | None, Moment]:
        """Seconds of the work from its beginning to its end, and that beginning."""
        first, last = self._first, self._last
        if first is not None and last is not None and last.done > first.done and self.expected is None:
            return (last.time - first.time) * (1 - first.done) / (last.done - first.done), first
        return self.expected, Moment(self.started, 0.0)


def expected(stage: str, seconds: float) -> float:
    """Seconds that a step of this ``stage`` will take, if one on another machine takes ``seconds``."""
    return seconds * _slower.get(stage, 1.0)


def learn(stage: str, seconds: float, took: float) -> None:
    """Note how long a step took for which ``seconds`` were expected."""
    if seconds > 0 and took > 0:
        _slower[stage] = _slower.get(stage, 1.0) * took / seconds


def second_stage(display: DisplayProfile, scale: int, method: str) -> float:
    """Seconds of the second stage of a frame, on a usual machine."""
    finished = display.eia_pixels[0] * display.eia_pixels[1] / 1e6
    rendered = finished / display.finished_pixels(scale)
    denoises = method.startswith(("denoise", "oidn"))
    return START + PER_FINISHED * finished + (PER_DENOISED if denoises else PER_RENDERED) * rendered
