"""Which lenses stand for the whole EIA when a full reference would take hours."""

from __future__ import annotations

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError

BACKGROUND_SHARE = 8  # one in so many chosen lenses is background, to catch what the mask missed
BITS = 16


def choose_lenses(mask: Array, count: int, seed: int = 0) -> tuple[tuple[int, int], ...]:
    """``count`` different random lenses, (row, column), in reading order.

    ``mask`` (sy, sx) bool is the foreground. One lens in eight is background
    where there is any, and at least two of eight or more, since one alone has no
    spread; the rest are foreground. Every lens of a group is equally
    likely, and each draw is spread over its group: equal steps from a random start
    along a curve that visits neighbours together (systematic sampling, Z-order).
    LfsrError if fewer than ``count`` lenses exist.
    """
    check_count(count, mask.size)
    foreground, background = np.argwhere(mask), np.argwhere(~mask)
    share = max(2, count // BACKGROUND_SHARE) if count >= BACKGROUND_SHARE else 0
    wanted = min(count - min(len(background), share), len(foreground))
    random = np.random.default_rng(seed)
    chosen = np.concatenate([spread(foreground, wanted, random), spread(background, count - wanted, random)])
    return tuple(sorted((int(row), int(column)) for row, column in chosen))


def check_count(count: int, lenses: int) -> None:
    """LfsrError unless so many of a display's ``lenses`` can be chosen."""
    if not 1 <= count <= lenses:
        raise LfsrError(f"number of lenses is {str(count)[:20]}, but it must be from 1 to the display's {lenses}")


def spread(lenses: Array, count: int, random: np.random.Generator) -> Array:
    """``count`` of ``lenses`` (n, 2) row and column, in equal steps along their Z-order from a random start."""
    ordered = lenses[np.argsort(_z_order(lenses))]
    places = (np.arange(count) + random.random()) * (len(lenses) / max(count, 1))
    return ordered[np.minimum(places.astype(int), len(lenses) - 1)]


def _z_order(lenses: Array) -> Array:
    """Place of each lens on the Z-order curve: the bits of row and column, interleaved."""
    bits = (lenses[:, :, None] >> np.arange(BITS)) & 1
    weights = 4 ** np.arange(BITS)
    return (bits * weights).sum(-1) @ np.array([2, 1])
