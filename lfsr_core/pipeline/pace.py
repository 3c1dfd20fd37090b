"""Heights of the bands of a long render: small enough to lose little of one, large enough to cost nothing."""

from __future__ import annotations

import dataclasses
import os

from lfsr_core.pipeline.parts import Part

SECONDS = 60.0  # that a band should take
LEAST, MOST = 0.01, 86_400.0
SECONDS_VARIABLE = "LFSR_SECONDS_PER_PART"  # environment variable that replaces it
MOST_PIXELS = 2048 * 2048  # of a band, as of a tile of Cycles
SLOW = 150_000  # path samples per second of a slow scene on two cores
TRIAL_ROWS, TRIAL_SAMPLES = 64, 2_000_000  # the trial is at most 1/64 of the rows, and so many path samples
AT_ONCE = 1.7  # × SECONDS: an image that takes no longer is rendered at once
TIMEOUT = 2.3  # × SECONDS: a render that takes longer is given up for a smaller one
GROWTH, SHRINK = 8, 16
WORTH = 0.1  # × SECONDS: a part that took less is not stored


def seconds_per_part() -> float:
    """Return how many seconds a part of a render should take."""
    try:
        return min(max(LEAST, float(os.environ.get(SECONDS_VARIABLE, SECONDS))), MOST)
    except ValueError:
        return SECONDS


def is_worth_storing(seconds: float) -> bool:
    """True for a part that took long enough to be stored."""
    return seconds >= WORTH * seconds_per_part()


@dataclasses.dataclass(frozen=True)
class Pace:
    """Bands of one image."""

    width: int  # of the image, pixels
    rows: int  # of the image
    samples: int  # per pixel
    seconds: float = dataclasses.field(default_factory=seconds_per_part)  # that a band should take

    @property
    def most(self) -> int:
        """Rows that fit into memory at once."""
        return max(1, MOST_PIXELS // self.width)

    @property
    def timeout(self) -> float:
        """Seconds after which a render is given up."""
        return TIMEOUT * self.seconds

    @property
    def is_short(self) -> bool:
        """True where even a slow scene can be rendered at once."""
        return self.rows <= self.most and self.rows * self._row_samples <= SLOW * self.seconds

    @property
    def trial(self) -> Part:
        """A few rows in the middle, where images tend to be slowest: little work that tells the cost of the rest."""
        size = max(1, min(self.rows // TRIAL_ROWS, TRIAL_SAMPLES // self._row_samples))
        first = (self.rows - size) // 2
        return Part(first, first + size)

    def takes_one(self, trial: Part) -> bool:
        """True where the whole image can be rendered at once, going by the seconds of the ``trial``."""
        return self.rows <= self.most and trial.seconds * self.rows / trial.size <= AT_ONCE * self.seconds

    def after(self, done: Part) -> int:
        """Rows of the band after ``done``, whose seconds are those of its samples alone."""
        wanted = int(done.size * self.seconds / max(done.seconds, 1e-3))
        return max(1, min(wanted, GROWTH * done.size, self.most))

    def after_timeout(self, given_up: Part) -> int:
        """Rows of the band after one that took too long."""
        return max(1, given_up.size // SHRINK)

    @property
    def _row_samples(self) -> int:
        return self.width * self.samples
