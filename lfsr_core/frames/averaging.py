"""Temporal averaging: how many frames of an animation, and the seed of each."""

from __future__ import annotations

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.request import MOST_SEED

MOST_AVERAGED = 8  # frames to each side


def check_averaging(count: int) -> None:
    """LfsrError if a frame cannot be averaged with ``count`` frames to each side."""
    if not 0 <= count <= MOST_AVERAGED:
        raise LfsrError(f"temporal averaging is {str(count)[:20]} frames to each side, but it must be 0 to "
                        f"{MOST_AVERAGED}")


def seed_in_turn(seed: int, number: int, count: int) -> int:
    """Return the seed of frame ``number`` of an animation with ``count`` averaged frames to each side.

    Neighbouring frames have each of the 2 · ``count`` + 1 seeds from ``seed`` on once, so that their mean does not
    flicker where nothing moves.
    """
    return (seed + (number - 1) % (2 * count + 1)) % (MOST_SEED + 1)
