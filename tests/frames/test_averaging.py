"""Temporal averaging: the number of frames, and their seeds."""

from __future__ import annotations

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.averaging import check_averaging, seed_in_turn
from lfsr_core.frames.request import MOST_SEED


@pytest.mark.parametrize("count", [-1, 9])
def test_impossible_counts_are_refused(count):
    with pytest.raises(LfsrError, match="0 to 8"):
        check_averaging(count)


def test_without_averaging_every_frame_has_the_seed_that_was_asked_for():
    assert {seed_in_turn(7, number, 0) for number in range(-3, 9)} == {7}
    assert 0 <= seed_in_turn(MOST_SEED, 3, 2) <= MOST_SEED
