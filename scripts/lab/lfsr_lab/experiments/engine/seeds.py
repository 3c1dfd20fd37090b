"""Means over seeds and lenses, and what is certain of them.

Values are (seeds, lenses). Their interval comes from a bootstrap over both: each draw takes as many seeds and as many
lenses as there are, with replacement, each on its own, and every seed is crossed with every lens. It is somewhat too
wide rather than too narrow, and no correction is made for a finite number of lenses. Draws of one size are always the
same, so that methods, samples and seeds that share their lenses are compared in pairs.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from lfsr_core.arrays import Array

DRAWS = 1000
TAILS = (0.025, 0.975)  # of a 95 % interval


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A mean over seeds and lenses."""

    mean: float
    low: float  # ends of the 95 % interval
    high: float
    spread: float | None  # standard deviation over seeds of the mean over lenses; None of one seed


def estimate(values: Array) -> Estimate:
    """Return the mean of ``values`` (seeds, lenses), with one row of what does not differ from seed to seed."""
    low, high = interval(replicates(values))
    per_seed = values.mean(1)
    return Estimate(float(values.mean()), low, high, float(per_seed.std(ddof=1)) if len(per_seed) > 1 else None)


def replicates(values: Array) -> Array:
    """Return the mean (DRAWS,) of ``values`` (seeds, lenses) in every draw."""
    seeds, lenses = (_weights(count, axis) for axis, count in enumerate(values.shape))
    return np.asarray(((seeds @ values) * lenses).sum(1))


def interval(drawn: Array) -> tuple[float, float]:
    """Return the ends of the 95 % interval of draws; infinite where the statistic was so in too many of them."""
    low, high = np.quantile(drawn, TAILS, method="nearest")
    return float(low), float(high)


@functools.cache
def _weights(count: int, axis: int) -> Array:
    """Return the weight of each of ``count`` seeds or lenses in every draw, (DRAWS, count)."""
    random = np.random.default_rng((axis, count))
    return random.multinomial(count, np.full(count, 1 / count), DRAWS) / count
