"""Numbers of frames, as people write them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.errors import LfsrError
from lfsr_core.sequence.numbers import parse_frames


@pytest.mark.parametrize(("text", "frames"), [
    ("1-4", (1, 2, 3, 4)), ("1-9x4", (1, 5, 9)), ("1-10x4", (1, 5, 9)), ("7", (7,)), ("9, 1,5-6,5", (9, 1, 5, 6)),
    ("-3--1", (-3, -2, -1)), ("-1-1", (-1, 0, 1)), ("0", (0,))])
def test_frames_are_read(text, frames):
    assert parse_frames(text) == frames


@given(st.lists(st.integers(-10**6, 10**6), min_size=1, max_size=20, unique=True))
def test_lists_keep_their_order(frames):
    assert parse_frames(",".join(map(str, frames))) == tuple(frames)


@pytest.mark.parametrize("text", ["", "a", "4-1", "1-4x0", "1-", "1-2-3", "1,,2", "1-99999999", "0-1000000", "9" * 99])
def test_what_is_no_frames_is_refused(text):
    with pytest.raises(LfsrError, match="frames "):
        parse_frames(text)
