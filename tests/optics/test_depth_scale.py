"""Scales by depth and rays."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lfsr_core.frames.request import MIN_VIEWS, MOST_SCALE, samples_at, scales_up_to, usual_rays
from lfsr_core.optics.depth_scale import LEAST_SAMPLES, MODEL, choose_scale, disparities
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import CameraArray
from tests.support.synthetic import FLAT, MINI
from tests.support.told import refuses

SMALL, LENTICULAR = load_display("small"), load_display("looking-glass-go")

DISPLAYS = st.sampled_from([SMALL, MINI, FLAT, LENTICULAR, load_display("looking-glass-16")])
MOVES = st.lists(st.floats(0, 1e6), min_size=1, max_size=20).map(np.array)
RAYS = st.floats(1 / 64, 256)


def array_of(display):
    return CameraArray.for_display(display, 2.0)


@pytest.mark.parametrize("display", [SMALL, MINI, FLAT], ids=lambda display: display.name)
@pytest.mark.parametrize("scale", [1, 2, 4])
def test_points_at_the_usable_depth_move_by_one_lens(display, scale):
    array = array_of(display)
    front, behind = display.depth_range_mm(scale)
    unit = array.distance / display.viewing_distance_mm
    depths = np.array([array.distance - front * unit, array.distance + behind * unit])
    moved = disparities(display, array, depths) * scale
    assert moved[np.isfinite(depths)] == pytest.approx(1)
    assert disparities(display, array, np.array([array.distance]))[0] == 0


@given(DISPLAYS, MOVES, RAYS, st.floats(1, 100), st.data())
def test_the_deeper_the_smaller(display, moves, rays, factor, data):
    """Wherever a point moves away from the display plane, the scale does not grow."""
    factors = np.array(data.draw(st.lists(st.floats(1, factor), min_size=len(moves), max_size=len(moves))))
    scales = scales_up_to(display)
    near, far = (choose_scale(display, points, scales, rays) for points in (moves, moves * factors))
    assert far.scale <= near.scale


@given(DISPLAYS, MOVES, RAYS, st.floats(1, 1000))
def test_the_more_rays_the_smaller(display, moves, rays, factor):
    few, many = (choose_scale(display, moves, scales_up_to(display), each) for each in (rays, rays * factor))
    assert many.scale <= few.scale


@given(DISPLAYS, MOVES, RAYS, st.sets(st.integers(1, 10), min_size=1))
def test_the_choice_loses_least_of_the_scales_that_get_a_sample(display, moves, rays, some):
    scales = some & {1, *display.scales()}
    assume(scales)
    choice = choose_scale(display, moves, scales, rays)
    assert choice.scale in scales and choice.reason.code == "scale-chosen"
    assert (choice.reason.values["scale"], choice.reason.values["largest"]) == (choice.scale, max(scales))
    enough = [scale for scale in scales if rays * display.finished_pixels(scale) >= LEAST_SAMPLES] or [max(scales)]
    losses = {scale: MODEL.loss(moves, scale, rays * display.finished_pixels(scale)) for scale in enough}
    assert losses[choice.scale] == min(losses.values())


def test_every_scale_is_chosen_at_some_depth():
    depths = array_of(SMALL).distance * (1 + np.geomspace(0.001, 100, 400))
    moves = disparities(SMALL, array_of(SMALL), depths)
    scales = [choose_scale(SMALL, np.full(5, move), (5, 4, 2, 1), 4).scale for move in moves * 4]
    assert scales == sorted(scales, reverse=True) and set(scales) == {5, 4, 2, 1}
    moves = np.zeros(200)
    moves[:4] = 1e6
    assert choose_scale(SMALL, moves, (4, 2, 1), 1).scale == 4
    assert choose_scale(SMALL, np.empty(0), (2, 4), 1).scale == 4
    assert choose_scale(SMALL, np.empty(0), (2, 4), 1).reason.code == "scale-unseen"
    assert choose_scale(SMALL, np.full(3, 1e9), (3,), 1).scale == 3
    beside = disparities(SMALL, array_of(SMALL), np.full(3, -1.0))
    assert choose_scale(SMALL, beside, (4, 1), 4).scale == 1, "beside the viewer is very near"


@given(st.sampled_from([1, 4, 16, 64]))
def test_rays_are_samples_times_rendered_pixels(rays):
    for display, scale in ((SMALL, 4), (SMALL, 5), (MINI, 2), (LENTICULAR, 3), (LENTICULAR, 2)):
        rendered = math.prod(display.low_views(scale)) / math.prod(display.views)
        assert samples_at(display, scale, rays) * rendered == pytest.approx(rays)


def test_usual_rays_are_sixteen_samples_at_scale_4():
    assert [usual_rays(display) for display in (SMALL, LENTICULAR)] == [1, 4]
    assert [samples_at(SMALL, scale, 1) for scale in (1, 2, 4, 5)] == [1, 4, 16, 25]
    assert samples_at(SMALL, 1, 0.1) == 1, "never fewer"
    assert usual_rays(SMALL, 64) == 4
    for rays in [0.0, -1.0, math.nan, math.inf, 2**22]:
        refuses(r"rays per finished pixel are .* above 0, and at most 1048", samples_at, SMALL, 4, rays)
    for views, scales in [
        (8, (2, 1)), (12, (2, 1)), (20, (4, 2, 1)), (15, (3, 1)), (9, (3, 1)), (25, (5, 1)), (40, (5, 4, 2, 1)),
        (60, (5, 4, 3, 2, 1))]:
        pixels = tuple(count * views for count in SMALL.lenses)
        assert scales_up_to(dataclasses.replace(SMALL, views=(views, views), panel_pixels=pixels)) == scales


@given(DISPLAYS)
def test_scales_divide_the_views(display):
    scales = scales_up_to(display)
    assert list(scales) == sorted(set(scales), reverse=True) and scales[-1] == 1
    for scale in scales:
        views = itertools.compress(display.low_views(scale), display.parallax)
        assert scale <= 2 or (scale <= MOST_SCALE and min(views) >= MIN_VIEWS)
