"""Scales by depth."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.optics.depth_scale import choose_scale, disparities, mean_disparity, scales_up_to
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import CameraArray
from tests.support.synthetic import FLAT, MINI

SMALL = load_display("small")


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


def test_the_deeper_the_smaller():
    array = array_of(SMALL)
    near = array.distance * np.linspace(0.98, 1.02, 50)
    assert choose_scale(SMALL, array, near, (4, 2, 1), 16).scale == 4
    depths = [array.distance * (1 + far) for far in np.geomspace(0.01, 100, 60)]
    chosen = [choose_scale(SMALL, array, np.full(5, depth), (4, 2, 1), 16) for depth in depths]
    scales = [choice.scale for choice in chosen]
    assert scales == sorted(scales, reverse=True) and set(scales) == {4, 2, 1}
    for choice in chosen:
        assert f"scale {choice.scale}" in choice.reason and ("and not 4" in choice.reason) == (choice.scale < 4)


def test_a_few_far_points_do_not_decide():
    array = array_of(SMALL)
    depths = np.full(200, array.distance)
    depths[:4] *= 50
    assert choose_scale(SMALL, array, depths, (4, 2, 1), 16).scale == 4


def test_more_samples_ask_for_more_views():
    array = array_of(SMALL)
    depths = np.full(5, array.distance * 1.8)
    chosen = [choose_scale(SMALL, array, depths, (4, 2, 1), samples) for samples in (1, 16, 64, 1024)]
    assert [choice.scale for choice in chosen] == sorted((choice.scale for choice in chosen), reverse=True)
    assert chosen[0].scale > chosen[-1].scale


@pytest.mark.parametrize(("samples", "scale"), [(4, 2), (16, 2), (64, 1)])
def test_half_of_the_views_are_enough_until_every_view_gets_many_samples(samples, scale):
    array = array_of(SMALL)
    depths = np.full(5, 2 * array.distance)
    assert 0.52 < mean_disparity(disparities(SMALL, array, depths), 2) < 0.95
    assert choose_scale(SMALL, array, depths, (4, 2, 1), samples).scale == scale


def test_every_view_takes_as_many_rays_as_half_of_them():
    far = np.full(5, 1e9)
    assert [choose_scale(SMALL, array_of(SMALL), far, (4, 2, 1), samples).samples for samples in (1, 16, 64)] == [
        1, 4, 16]


def test_nothing_seen_or_nothing_to_choose_from():
    array = array_of(SMALL)
    assert choose_scale(SMALL, array, np.empty(0), (2, 4), 16).scale == 4
    assert choose_scale(SMALL, array, np.full(3, 1e9), (3,), 16).scale == 3
    assert choose_scale(SMALL, array, np.full(3, -1.0), (4, 1), 16).scale == 1, "beside the viewer is very near"


@pytest.mark.parametrize(("views", "scales"), [(8, (2, 1)), (12, (2, 1)), (20, (4, 2, 1)), (15, (3, 1)), (9, (3, 1))])
def test_scales_leave_enough_views(views, scales):
    pixels = tuple(count * views for count in SMALL.lenses)
    assert scales_up_to(dataclasses.replace(SMALL, views=(views, views), panel_pixels=pixels)) == scales


def test_scales_divide_the_views():
    assert scales_up_to(SMALL) == (4, 2, 1)
    for display in (SMALL, MINI, FLAT, load_display("looking-glass-go")):
        for scale in scales_up_to(display):
            display.low_views(scale)
