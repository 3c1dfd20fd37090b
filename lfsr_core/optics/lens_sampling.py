"""Lenses that stand for the whole EIA where a full reference would take hours."""

from __future__ import annotations

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError

LENSES_PER_BACKGROUND = 8  # one chosen lens in eight is background: it finds foreground that the mask missed
BITS = 16


def choose_lenses(mask: Array, count: int, seed: int = 0) -> tuple[tuple[int, int], ...]:
    """Return ``count`` different random lenses, (row, column), in reading order.

    ``mask`` (sy, sx) bool is the foreground. One lens in eight is background where there is
    any; of eight or more lenses at least two are, because one alone has no spread. The others
    are foreground. Every lens of a group is equally likely. LfsrError if fewer than ``count`` lenses exist.
    """
    check_count(count, mask.size)
    foreground, background = np.argwhere(mask), np.argwhere(~mask)
    most = max(2, count // LENSES_PER_BACKGROUND) if count >= LENSES_PER_BACKGROUND else 0
    wanted = min(count - min(len(background), most), len(foreground))
    random = np.random.default_rng(seed)
    chosen = np.concatenate([systematic_sample(foreground, wanted, random),
                             systematic_sample(background, count - wanted, random)])
    return tuple(sorted((int(row), int(column)) for row, column in chosen))


def check_count(count: int, lenses: int) -> None:
    """LfsrError unless ``count`` is from 1 to the number of ``lenses`` of a display."""
    if not 1 <= count <= lenses:
        raise LfsrError(f"number of lenses is {str(count)[:20]}, but it must be from 1 to the display's {lenses}")


def systematic_sample(lenses: Array, count: int, random: np.random.Generator) -> Array:
    """Return ``count`` of ``lenses`` (n, 2), row and column, spread evenly: equal steps along a Z-order curve.

    The start is random, so every lens is equally likely.
    """
    bits = (lenses[:, :, None] >> np.arange(BITS)) & 1
    z_order = (bits * 4 ** np.arange(BITS)).sum(-1) @ np.array([2, 1])
    places = (np.arange(count) + random.random()) * (len(lenses) / max(count, 1))
    chosen: Array = lenses[np.argsort(z_order)][np.minimum(places.astype(int), len(lenses) - 1)]
    return chosen
