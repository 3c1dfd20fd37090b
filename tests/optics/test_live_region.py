"""A rendered pixel of a live window is one view of one lens, whatever the window's size."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.display import load_display
from lfsr_core.optics.eye_card import LiveRegion

SMALL = load_display("small")
sides = st.integers(1, 2000)


def test_exact_region_has_nothing_to_say():
    region = LiveRegion(SMALL, SMALL.panel_pixels, 4)
    assert region.sentence() is None
    assert region.corner == (0, 0) and region.shift == (0, 0) and region.drawn == SMALL.panel_pixels


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


@pytest.mark.parametrize(("size", "words"), [
    ((960, 540), "centred part"), ((640, 480), "centred part"), ((1920, 1080), "in the middle of a border"),
    ((1281, 1000), "views mix"), ((640, 479), "views mix")])
def test_another_size_says_what_is_and_what_should_be(size, words):
    sentence = LiveRegion(SMALL, size, 4).sentence()
    assert words in sentence and f"{size[0]}×{size[1]}" in sentence and "960×560" in sentence
    assert len(sentence) < 300
