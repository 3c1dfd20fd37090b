"""How much time is left of long work, from its progress, the clock and the CPU seconds that it takes."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.base.notices import Progress

LEAST_LEFT = 0.5  # seconds
PACE = 0.85  # of Cycles' later samples of one image, against the mean of those before them
LATE = 0.1  # work that is silent for longer than expected takes at least this part of its silence more
BEATS, LEAST_BEATS = 12, 2.0  # reports, and seconds from the first of them, that tell how fast the work goes of late
LEAST_RATE = 0.1  # CPU seconds per second; below, the process waits for a GPU


@dataclasses.dataclass(frozen=True)
class _Moment:
    time: float
    done: float  # fraction, 0 to 1
    cpu: float | None  # seconds until then


class TimeLeft:
    """Follows one piece of work; every ``now`` is of one clock that only runs forward.

    The rest takes as long per fraction as what is done. Other programs take and leave cores meanwhile: where the work
    gets fewer CPU seconds of late than before, the rest takes longer, by the square root of the ratio, since it may
    get them back. On 17 recorded renders the answer is right within a third, or 2 s, in 84 % of the looks.
    """

    def __init__(self, after: float = 0.0, is_image: bool = False) -> None:
        """``after``: seconds of what follows the work; ``is_image``: whether it is one image that Cycles renders."""
        self.after, self.is_image = after, is_image
        self._heard: list[_Moment] = []  # since the work itself began, after scenes were opened and prepared
        self._beats: list[tuple[float, float]] = []  # times and CPU seconds of the last reports
        self._ended = self._cpu = 0.0  # CPU seconds of processes that have ended, and of the one that works

    def hear(self, told: Progress, now: float) -> None:
        """Take a report."""
        cpu = None
        if told.cpu is not None:
            if told.cpu < self._cpu:  # of another process
                self._ended += self._cpu
            self._cpu = told.cpu
            cpu = self._ended + told.cpu
            self._beats = [*self._beats[1 - BEATS:], (now, cpu)]
        if told.repeated:
            return
        if not self._heard or told.fraction <= self._heard[0].done:
            self._heard = [_Moment(now, told.fraction, cpu)]
        elif told.fraction > self._heard[-1].done:
            self._heard.append(_Moment(now, told.fraction, cpu))

    def left(self, now: float) -> float | None:
        """Seconds left, None while they cannot be told."""
        if len(self._heard) < 2:
            return None
        first, last = self._heard[0], self._heard[-1]
        silence, spent = now - last.time, last.time - first.time
        if last.done >= 1:
            return max(self.after - silence, LATE * silence, LEAST_LEFT)
        rest = spent / (last.done - first.done) * (1 - last.done)
        if self.is_image and len(self._heard) > 2:
            rest *= PACE
        (begin, least), (end, most) = (self._beats[0], self._beats[-1]) if self._beats else ((0.0, 0.0), (0.0, 0.0))
        if end - begin >= LEAST_BEATS and spent > 0 and first.cpu is not None and last.cpu is not None:
            late, before = (most - least) / (end - begin), (last.cpu - first.cpu) / spent
            if late > LEAST_RATE and before > LEAST_RATE:
                rest *= math.sqrt(before / late)
        return max(rest - silence, LATE * silence, LEAST_LEFT) + self.after
