"""How much time is left of long work, from its progress, the clock and the CPU seconds that it takes."""

from __future__ import annotations

import dataclasses

from lfsr_core.base.notices import Progress

LEAST_LEFT = 0.5  # seconds
BEATS = 6  # reports that say how many CPU seconds the work gets of late
LEAST_RATE = 0.1  # CPU seconds per second; below, the process waits for a GPU, and only the clock counts


@dataclasses.dataclass(frozen=True)
class _Moment:
    time: float
    done: float  # fraction, 0 to 1
    work: float | None  # CPU seconds until then


class TimeLeft:
    """Follows one piece of work; every ``now`` is of one clock that only runs forward.

    Other programs take and leave cores meanwhile, but work takes the same CPU seconds: so work is counted in these, at
    the rate of the last reports. What is left takes as much per fraction as the latter half of what is done.
    """

    def __init__(self, after: float = 0.0) -> None:
        """``after``: seconds of what follows the work."""
        self.after = after
        self._heard: list[_Moment] = []  # since the work itself began, after scenes were opened and prepared
        self._beats: list[tuple[float, float]] = []  # times and CPU seconds of the last reports
        self._ended = self._cpu = 0.0  # CPU seconds of processes that have ended, and of the one that works

    def hear(self, told: Progress, now: float) -> None:
        """Take a report."""
        work = None
        if told.cpu is not None:
            if told.cpu < self._cpu:  # of another process
                self._ended += self._cpu
            self._cpu = told.cpu
            work = self._ended + told.cpu
            self._beats = [*self._beats[1 - BEATS:], (now, work)]
        if told.repeated:
            return
        if not self._heard or told.fraction <= self._heard[0].done:
            self._heard = [_Moment(now, told.fraction, work)]
        elif told.fraction > self._heard[-1].done:
            self._heard.append(_Moment(now, told.fraction, work))

    def left(self, now: float) -> float | None:
        """Seconds left, None while they cannot be told."""
        if len(self._heard) < 2:
            return None
        first, last = self._heard[0], self._heard[-1]
        half = (first.done + last.done) / 2
        since = next(moment for moment in reversed(self._heard) if moment.done <= half)
        rate = 0.0
        if len(self._beats) > 1:
            (begin, least), (end, most) = self._beats[0], self._beats[-1]
            rate = (most - least) / max(end - begin, 1e-3)
        if rate < LEAST_RATE or since.work is None or last.work is None:
            spent, gone, rate = last.time - since.time, now - last.time, 1.0
        else:
            spent = last.work - since.work
            gone = self._beats[-1][1] + rate * (now - self._beats[-1][0]) - last.work
        left = (spent / (last.done - since.done) * (1 - last.done) - gone) / rate
        # Work that is late by some seconds is expected to take as many more.
        return max(abs(left), LEAST_LEFT) + self.after
