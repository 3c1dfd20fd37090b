"""Which lenses stand for the whole EIA when a full reference would take hours."""

from __future__ import annotations

import numpy as np

from lfsr_core.errors import LfsrError

BACKGROUND_SHARE = 8  # one in so many chosen lenses is background, to catch what the mask missed


def choose_lenses(mask: np.ndarray, count: int, seed: int = 0) -> tuple[tuple[int, int], ...]:
    """``count`` different random lenses, (row, column), in reading order.

    ``mask`` (sy, sx) bool is the foreground. One lens in eight is background
    where there is any; the rest are foreground. Inside each group the lenses are
    cut into equal runs in reading order with one drawn from every run, so each
    lens of a group is equally likely (up to rounding of the runs) and the draw is
    spread over the picture. LfsrError if fewer than ``count`` lenses exist.
    """
    if not 1 <= count <= mask.size:
        raise LfsrError(f"number of lenses is {count}, but it must be from 1 to the display's {mask.size}")
    foreground, background = np.argwhere(mask), np.argwhere(~mask)
    wanted = count - min(len(background), count // BACKGROUND_SHARE)
    wanted = min(wanted, len(foreground))
    random = np.random.default_rng(seed)
    chosen = np.concatenate([_spread(foreground, wanted, random), _spread(background, count - wanted, random)])
    return tuple(sorted((int(row), int(column)) for row, column in chosen))


def _spread(lenses: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
    """One random lens from each of ``count`` equal runs of ``lenses`` (n, 2)."""
    return np.array([random.choice(run) for run in np.array_split(lenses, count)] if count else [],
                    dtype=int).reshape(-1, 2)
