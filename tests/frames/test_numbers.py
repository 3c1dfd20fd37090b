"""Numbers of frames: as people write them, and a few that are spread over many."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.frames.request import parse_frames, spread
from tests.support.told import refuses


@pytest.mark.parametrize(("text", "frames"), [
    ("1-4", (1, 2, 3, 4)), ("1-9x4", (1, 5, 9)), ("1-10x4", (1, 5, 9)), ("1-9:4", (1, 5, 9)), ("7", (7,)),
    ("9, 1,5-6,5", (9, 1, 5, 6)), ("-3--1", (-3, -2, -1)), ("-1-1", (-1, 0, 1)), ("0", (0,))])
def test_frames_are_read(text, frames):
    assert parse_frames(text) == frames


@given(st.lists(st.integers(-10**6, 10**6), min_size=1, max_size=20, unique=True))
def test_lists_keep_their_order(frames):
    assert parse_frames(",".join(map(str, frames))) == tuple(frames)


@pytest.mark.parametrize("text", ["", "a", "4-1", "1-4x0", "1-", "1-2-3", "1,,2", "1-99999999", "0-1000000", "9" * 99])
def test_what_is_no_frames_is_refused(text):
    refuses("frames ", parse_frames, text)


@given(st.lists(st.integers(), unique=True, max_size=30), st.integers(1, 9))
def test_a_few_are_spread_over_all(frames, most):
    few = spread(frames, most)
    assert len(few) == min(len(frames), most) and set(few) <= set(frames)
    assert most < 2 or not frames or (few[0], few[-1]) == (frames[0], frames[-1])
    steps = [frames.index(second) - frames.index(first) for first, second in itertools.pairwise(few)]
    assert not steps or max(steps) - min(steps) <= 1
