"""Choices of lenses: random ones, rows of them, and those of a live window."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.display import load_display
from lfsr_core.optics.eye import LiveRegion
from lfsr_core.optics.lenses import check_cover, choose_lenses, parse_rows, pixel_rows
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
    assert {type(number) for lens in choose_lenses(MASK, 5) for number in lens} == {int}
    for mask in [np.ones((3, 4), bool), np.zeros((3, 4), bool)]:
        assert len(choose_lenses(mask, 12)) == 12
        assert len(set(choose_lenses(mask, 9))) == 9
    for count in [0, -1, 193]:
        refuses(f"number of lenses is {count}, .*192", choose_lenses, MASK, count)


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


@given(st.integers(1, 200), st.data())
def test_shares_are_the_whole_and_of_one_size(count, data):
    count_of_parts = data.draw(st.integers(1, count))
    parts = [parse_rows(f"{number}/{count_of_parts}", count) for number in range(1, count_of_parts + 1)]
    check_cover(data.draw(st.permutations(parts)), count)
    sizes = {last - first + 1 for first, last in parts}
    assert max(sizes) - min(sizes) <= 1 and min(sizes) >= 1


def test_rows_as_people_write_them_and_parts_that_are_not_the_whole():
    assert pixel_rows((1, 3), 4) == (0, 12) and pixel_rows((4, 4), 4) == (12, 16)
    for text, rows in [("3-7", (3, 7)), (" 4 ", (4, 4)), ("12-12", (12, 12)), ("1/1", (1, 12))]:
        assert parse_rows(text, 12) == rows
    for text in ["", "0-3", "5-4", "9-13", "a-b", "1/13", "0/2", "3/2", "-3", "1-2-3", "1-", "1" * 99]:
        refuses("rows are ", parse_rows, text, 12)
    for parts, sentence in [
        ([(1, 4), (6, 12)], "rows 5 are in none"), ([(2, 12)], "rows 1 are in none"),
        ([(1, 9)], "rows 10-12 are in none"), ([(1, 6), (5, 12)], "rows 5-6 are in more than one"),
        ([(1, 12), (3, 4)], "rows 3-4 are in more than one")]:
        refuses(sentence, check_cover, parts, 12)


SMALL = load_display("small")
sides = st.integers(1, 2000)


def test_a_region_says_where_its_size_is_another():
    region = LiveRegion(SMALL, SMALL.panel_pixels, 4)
    assert region.sentence() is None
    assert region.corner == (0, 0) and region.shift == (0, 0) and region.drawn == SMALL.panel_pixels
    for size, words in [
        ((960, 540), "centred part"), ((640, 480), "centred part"), ((1920, 1080), "in the middle of a border"),
        ((1281, 1000), "views mix"), ((640, 479), "views mix")]:
        sentence = LiveRegion(SMALL, size, 4).sentence()
        assert words in sentence and f"{size[0]}×{size[1]}" in sentence and "960×560" in sentence
        assert len(sentence) < 300


@given(width=sides, height=sides, scale=st.sampled_from((1, 2, 4, 8)))
def test_panel_is_in_the_middle_of_whole_rendered_pixels(width, height, scale):
    region = LiveRegion(SMALL, (width, height), scale)
    for axis, side in enumerate((width, height)):
        corner, panel = region.corner[axis], SMALL.panel_pixels[axis]
        assert corner % scale == 0 and region.drawn[axis] % scale == 0
        assert side - scale < region.drawn[axis] <= side
        right = side - panel - corner
        assert abs(right - corner) < 3 * scale, "as much on both sides"
        assert region.shift[axis] == corner + panel / 2 - side / 2
