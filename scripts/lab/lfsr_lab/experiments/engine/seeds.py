"""Means over seeds and lenses, and what is certain of them.

Values are (seeds, lenses). Their interval comes from a bootstrap over both: each draw takes as many seeds and as many
lenses as there are, with replacement, and every seed is crossed with every lens; neighbouring lenses can be drawn in
blocks. It is somewhat too wide rather than too narrow, and no correction is made for a finite number of lenses. Draws
of one size are always the same, so that what shares seeds and lenses is compared in pairs.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from lfsr_core.base.arrays import Array

DRAWS = 1000
BLOCK = 3  # lenses along each side
TAILS = (0.025, 0.975)  # of a 95 % interval


@dataclasses.dataclass(frozen=True)
class Estimate:
    mean: float
    low: float  # ends of the 95 % interval
    high: float
    spread: float | None  # standard deviation over seeds of the mean over lenses; None of one seed


def estimate(values: Array, blocks: Array | None = None) -> Estimate:
    """Return the mean of ``values`` (seeds, lenses), with one row of what does not differ from seed to seed."""
    low, high = interval(replicates(values, blocks))
    per_seed = values.mean(1)
    return Estimate(float(values.mean()), low, high, float(per_seed.std(ddof=1)) if len(per_seed) > 1 else None)


def replicates(values: Array, blocks: Array | None = None) -> Array:
    """Return the mean (DRAWS,) of ``values`` (seeds, lenses) in every draw.

    ``blocks`` (lenses,): lenses with the same whole number are drawn together, as neighbours that see nearly the same.
    """
    seeds = _counts(len(values), 0)
    lenses = (_counts(values.shape[1], 1) if blocks is None else
              _counts(int(blocks.max(initial=-1)) + 1, 1)[:, blocks])  # how often each lens is in each draw
    return np.asarray((seeds @ values * lenses).sum(1) / (len(values) * lenses.sum(1)))


def blocks_of(lenses: Array) -> Array:
    """Return the block (n,) of BLOCK × BLOCK neighbours of each of ``lenses`` (n, 2), row and column."""
    return np.unique(lenses // BLOCK, axis=0, return_inverse=True)[1].ravel()


def interval(drawn: Array) -> tuple[float, float]:
    """Return the ends of the 95 % interval of draws; infinite where the statistic was so in too many of them."""
    low, high = np.quantile(drawn, TAILS, method="nearest")
    return float(low), float(high)


@functools.cache
def _counts(count: int, axis: int) -> Array:
    """Return how often each of ``count`` seeds or lenses is in each draw, (DRAWS, count)."""
    random = np.random.default_rng((axis, count))
    return random.multinomial(count, np.full(count, 1 / count), DRAWS)
