"""The lens card's quads and sums give the rays of rays.py, whatever the layout."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.optics.lens_card import RIM, card_rays, lens_card
from lfsr_core.optics.rays import CameraArray, RayLayout
from tests.support.rays import pixel_rays

ARRAY = CameraArray(distance=3.0, half_width=1.2, half_height=0.7, spacing=0.1)


@st.composite
def layouts(draw):
    lenses, views = (tuple(draw(st.integers(1, most)) for _ in range(2)) for most in (6, 5))
    lens = st.tuples(st.integers(0, lenses[1] - 1), st.integers(0, lenses[0] - 1))
    return RayLayout(lenses, views, ARRAY, draw(st.floats(0.01, 1)), draw(st.sampled_from(("centred", "paper"))),
                     draw(st.floats(0, 1)), draw(st.none() | st.lists(lens, min_size=1, max_size=9).map(tuple)))


def quads_at(card, layout, place):
    """Attributes (H, W, 2), interpolated at ``place`` of every pixel, and where on the card that is."""
    across, down = layout.tiles
    px, py = layout.views
    column, row = np.meshgrid(np.arange(across * px), np.arange(down * py))
    quad = row // py * across + column // px
    wanted = np.stack([column % px + place[0], row % py + place[1]], -1)

    def corners_of(values):
        return [values[quad, corner] for corner in (0, 1, 3)]
    upper_left, lower_left, upper_right = corners_of(card.cells)
    right = (wanted - upper_left)[..., :1] / (upper_right - upper_left)[..., :1]
    down = (wanted - upper_left)[..., 1:] / (lower_left - upper_left)[..., 1:]

    def at(values):
        upper_left, lower_left, upper_right = corners_of(values)
        return upper_left + right * (upper_right - upper_left) + down * (lower_left - upper_left)
    return at(card.cells), card.targets[quad], at(card.corners)


@settings(deadline=None, max_examples=60)
@given(layouts(), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_rays_of_the_card_are_those_of_the_layout(layout, right, down):
    card = lens_card(layout)
    cells, targets, _ = quads_at(card, layout, (right, down))
    found = card_rays(card, cells, targets, ARRAY.distance)
    for ours, expected in zip(found, pixel_rays(layout, (right, down)), strict=True):
        assert ours == pytest.approx(expected, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(layouts())
def test_pixels_lie_where_an_orthographic_camera_sees_them(layout):
    """Square pixels as large as a lens, the upper left one first, the card's centre in the middle."""
    card = lens_card(layout)
    width, height = layout.size
    _, _, places = quads_at(card, layout, (0.5, 0.5))
    right = (np.arange(width) + 0.5 - width / 2) * card.pixel
    up = (height / 2 - np.arange(height) - 0.5) * card.pixel
    assert places == pytest.approx(np.stack(np.meshgrid(right, up), -1), abs=1e-9)
    assert card.pixel == pytest.approx(2 * ARRAY.half_width / layout.lenses[0])
    assert np.ptp(card.corners.reshape(-1, 2), axis=0) == pytest.approx((np.array(layout.size) + 2 * RIM) * card.pixel)


def test_a_cell_is_filled_from_edge_to_edge():
    layout = RayLayout((2, 2), (4, 4), ARRAY, 2 * ARRAY.spacing, view_aperture=0.5)
    card = lens_card(layout)
    corner = np.zeros((1, 2))
    starts = [card_rays(card, corner, corner, ARRAY.distance, value)[0][0, :2] for value in (0.0, 1.0)]
    assert np.abs(starts[1] - starts[0]) == pytest.approx([ARRAY.spacing / 2] * 2)


def test_paper_has_no_view_aperture():
    card = lens_card(RayLayout((2, 2), (4, 4), ARRAY, 0.4, "paper"))
    assert card.aperture == (0, 0) and not card.place_in_pixel
