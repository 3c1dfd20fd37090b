"""The geometry that the parameter sweeps speak of."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import CameraArray, RayLayout, rays
from lfsr_lab.experiments.sweeps.measure import DISPLAY_FILE
from lfsr_lab.scenes.sweeps.space import Space, card_centre, card_of_motion, hole, rectangle_path
from tests.support.rays import pixel_rays
from tests.support.synthetic import FLAT

DISPLAYS = [load_display(DISPLAY_FILE), load_display("mini"), load_display("small")]
OBLONG = dataclasses.replace(DISPLAYS[1], name="oblong", lenses=(16, 24), views=(8, 4))  # rows half a lens high


@pytest.mark.parametrize("display", DISPLAYS, ids=lambda display: display.name)
@pytest.mark.parametrize("scale", [2, 4])
def test_usable_depth_is_the_displays_own(display, scale):
    space, pitch = Space.of(display, scale), display.lens_pitch_mm[0]
    front, behind = display.depth_range_mm(scale)
    assert space.front * pitch == pytest.approx(front, rel=1e-3)
    assert space.behind * pitch == pytest.approx(behind, rel=1e-3)
    assert (space.slope(space.depth(1)), space.slope(space.depth(-1))) == pytest.approx((1, -1))
    assert space.slope(space.depth_of_slope(0.7)) == pytest.approx(0.7)


@pytest.mark.parametrize("display", DISPLAYS, ids=lambda display: display.name)
@pytest.mark.parametrize("y", [-3.0, 0.0, 5.0])
def test_footprint_and_window_hold_the_rays_that_are_sent(display, y):
    space = Space.of(display, 4)
    layout = RayLayout.for_display(display, CameraArray.for_display(display, display.lenses[0]))
    width = layout.size[0]
    # The outermost rays of the first pixel and of the last one in a row.
    raster, random = np.array([0, 1 - 1e-9, width - 1, width - 1e-9]) / width, np.array([0, 1 - 1e-9, 0, 1 - 1e-9])
    pixel = [meet(layout, raster[:2], random[order], y) for order in ([0, 1], [1, 0])]
    assert max(np.ptp(places) for places in pixel) == pytest.approx(space.footprint(y), rel=1e-6)
    every = np.array([meet(layout, np.array([place]), np.array([number]), y)[0]
                      for place in np.linspace(0, 1 - 1e-9, 4 * width + 1) for number in (0, 1 - 1e-9)])
    assert np.abs(every).max() <= space.window(y)[0] * (1 + 1e-6)
    assert np.abs(every).max() >= space.window(y)[0] - space.footprint(y)


@pytest.mark.parametrize("display", [*DISPLAYS, OBLONG, FLAT], ids=lambda display: display.name)
@pytest.mark.parametrize("y", [0.0, 5.0])
def test_the_window_is_as_high_as_what_is_seen(display, y):
    space, layout = Space.of(display, 2), RayLayout.for_display(display, CameraArray.for_display(
        display, display.lenses[0]))
    origin, direction = pixel_rays(layout)
    seen = np.abs(origin + direction * ((layout.array.distance + y) / direction[..., 2:]))[..., 1].max()
    height = space.window(y)[1]
    assert height - space.footprint(y, axis=1) <= seen <= height
    assert space.size == pytest.approx((2 * layout.array.half_width, 2 * layout.array.half_height), rel=1e-3)


def meet(layout, raster_x, random_x, y):
    """Where rays meet the depth ``y``, rightwards."""
    origin, direction = rays(layout, raster_x, np.full_like(raster_x, 0.5), random_x)
    depth = layout.array.distance + y
    return origin[:, 0] + direction[:, 0] / direction[:, 2] * depth


def test_a_depth_at_the_viewer_or_a_slope_beyond_the_display_is_refused():
    space = Space.of(load_display("small"), 4)
    with pytest.raises(LfsrError, match="at the viewer"):
        space.depth(-4)
    with pytest.raises(LfsrError, match="the limit is 2.47"):
        space.depth_of_slope(4)


def test_gratings_beyond_nyquist_alias_in_an_elemental_image():
    space = Space.of(DISPLAYS[0], 4)
    y = space.depth(1)
    low_pixel = space.scale * space.spacing * y / space.distance  # through one point of a lens
    assert space.nyquist(y) * low_pixel == pytest.approx(0.5)


@pytest.mark.parametrize("share", [1, 0.75, 0.5, 0.25, 0.1, 0.05, 0.02])
def test_a_hole_is_a_block_of_lenses_of_nearly_that_share(share):
    columns, rows = hole((12, 8), share)
    assert 1 <= columns <= 12 and 1 <= rows <= 8
    assert columns * rows / 96 == pytest.approx(share, abs=0.006)


@given(st.integers(2, 40), st.integers(1, 3), st.integers(1, 9), st.integers(1, 9))
def test_the_path_takes_equal_steps_along_one_axis_and_stays_in_its_room(frames, step, across, down):
    path = rectangle_path(frames, step, (across, down))
    assert len(path) == frames and path[0] == (0, 0)
    for (x0, y0), (x1, y1) in itertools.pairwise(path):
        assert sorted((abs(x1 - x0), abs(y1 - y0))) == [0, step]
    assert all(0 <= x <= max(across, step) and 0 <= y <= max(down, step) for x, y in path)


def test_a_card_at_rest_stays():
    assert set(rectangle_path(5, 0, (3, 3))) == {(0, 0)}


def test_the_moving_card_fits_the_display_and_its_path_is_centred():
    space = Space.of(DISPLAYS[0], 4)
    y, half, path = card_of_motion(space, 1, 24)
    centres = np.array([card_centre(space, y, place, path) for place in path])
    assert centres.min(0) + centres.max(0) == pytest.approx([0, 0])
    assert (np.abs(centres).max(0) + half <= np.array(space.lenses) / 2 * space.magnified(y)).all()
    # Downwards in lenses is downwards in the scene.
    first_down = next(index for index, place in enumerate(path) if place[1])
    assert centres[first_down][1] < centres[first_down - 1][1]
    assert math.isclose(abs(centres[1][0] - centres[0][0]), space.magnified(y))
