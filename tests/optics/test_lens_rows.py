"""Rows of lenses: parts that cover the display, and errors for those that do not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.lenses import check_cover, parse_rows, pixel_rows
from tests.support.told import refuses


@given(st.integers(1, 200), st.data())
def test_shares_are_the_whole_and_of_one_size(count, data):
    count_of_parts = data.draw(st.integers(1, count))
    parts = [parse_rows(f"{number}/{count_of_parts}", count) for number in range(1, count_of_parts + 1)]
    check_cover(data.draw(st.permutations(parts)), count)
    sizes = {last - first + 1 for first, last in parts}
    assert max(sizes) - min(sizes) <= 1 and min(sizes) >= 1


@pytest.mark.parametrize(("text", "rows"), [("3-7", (3, 7)), (" 4 ", (4, 4)), ("12-12", (12, 12)), ("1/1", (1, 12))])
def test_rows_are_read(text, rows):
    assert parse_rows(text, 12) == rows


@pytest.mark.parametrize("text", ["", "0-3", "5-4", "9-13", "a-b", "1/13", "0/2", "3/2", "-3", "1-2-3", "1-", "1" * 99])
def test_rows_that_are_none_are_refused(text):
    refuses("rows are ", parse_rows, text, 12)


@pytest.mark.parametrize(("parts", "sentence"), [
    ([(1, 4), (6, 12)], "rows 5 are in none"), ([(2, 12)], "rows 1 are in none"), ([(1, 9)], "rows 10-12 are in none"),
    ([(1, 6), (5, 12)], "rows 5-6 are in more than one"), ([(1, 12), (3, 4)], "rows 3-4 are in more than one")])
def test_parts_that_are_not_the_whole_are_refused(parts, sentence):
    refuses(sentence, check_cover, parts, 12)


def test_pixel_rows_of_neighbours_meet():
    assert pixel_rows((1, 3), 4) == (0, 12) and pixel_rows((4, 4), 4) == (12, 16)
