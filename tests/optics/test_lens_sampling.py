"""Random lenses: different, repeatable, spread over the foreground, each equally likely."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.lenses import choose_lenses
from tests.support.told import refuses

MASK = np.zeros((12, 16), bool)
MASK[2:10, 4:14] = True  # 80 of 192


def on_mask(lenses: tuple[tuple[int, int], ...], mask: np.ndarray = MASK) -> int:
    return sum(mask[lens] for lens in lenses)


@given(st.integers(1, 192), st.integers(0, 2**32))
def test_count_is_kept_and_no_lens_comes_twice(count, seed):
    lenses = choose_lenses(MASK, count, seed)
    assert len(lenses) == len(set(lenses)) == count
    assert list(lenses) == sorted(lenses)


@pytest.mark.parametrize(("count", "background"), [(1, 0), (7, 0), (8, 2), (16, 2), (23, 2), (24, 3), (80, 10)])
def test_one_in_eight_is_background(count, background):
    for seed in range(5):
        assert on_mask(choose_lenses(MASK, count, seed)) == count - background


def test_same_seed_same_lenses_other_seed_others():
    assert choose_lenses(MASK, 20, 1) == choose_lenses(MASK, 20, 1)
    assert choose_lenses(MASK, 20, 1) != choose_lenses(MASK, 20, 2)


def test_lenses_are_python_integers_for_json():
    assert {type(number) for lens in choose_lenses(MASK, 5) for number in lens} == {int}


@given(st.integers(0, 1000))
def test_draw_is_spread_over_the_foreground(seed):
    lenses = np.array([lens for lens in choose_lenses(MASK, 40, seed) if MASK[lens]])
    left, top = lenses[:, 1] < 9, lenses[:, 0] < 6
    corners = [int((left == a).astype(int) @ (top == b)) for a in (False, True) for b in (False, True)]
    assert sum(corners) == 35
    # Chance alone would leave this band in one draw of six.
    assert all(6 <= corner <= 12 for corner in corners), corners


def test_each_foreground_lens_is_equally_likely():
    hits = np.zeros(MASK.shape)
    for seed in range(2000):
        for lens in choose_lenses(MASK, 9, seed):
            hits[lens] += 1
    expected = 2000 * 7 / 80
    assert np.abs(hits[MASK] - expected).max() < 5 * expected**0.5


@pytest.mark.parametrize("mask", [np.ones((3, 4), bool), np.zeros((3, 4), bool)])
def test_pure_masks(mask):
    assert len(choose_lenses(mask, 12)) == 12
    assert len(set(choose_lenses(mask, 9))) == 9


@pytest.mark.parametrize("count", [0, -1, 193])
def test_impossible_counts_are_refused(count):
    refuses(f"number of lenses is {count}, .*192", choose_lenses, MASK, count)
