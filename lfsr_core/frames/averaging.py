"""Frames of an animation that share: how many, and the seed of each."""

from __future__ import annotations

from lfsr_core.errors import LfsrError
from lfsr_core.frames.job import MOST_SEED

MOST_SHARED = 8  # frames to each side


def check_shared(count: int) -> None:
    """LfsrError if so many frames to each side cannot be shared."""
    if not 0 <= count <= MOST_SHARED:
        raise LfsrError(f"{str(count)[:20]} frames to each side were to be shared, but it must be 0 to {MOST_SHARED}")


def seed_in_turn(seed: int, number: int, count: int) -> int:
    """The seed of frame ``number``, of as many in turn as frames share; ``seed`` itself where none do.

    So the frames near one always have each of the seeds once, and where nothing moves their mean stands still.
    """
    return (seed + (number - 1) % (2 * count + 1)) % (MOST_SEED + 1)
