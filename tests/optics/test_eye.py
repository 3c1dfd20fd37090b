"""The simulated eye, and the card that shows what it sees."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.optics.display import load_display
from lfsr_core.optics.eye import eye_card, eye_place, eye_region, eye_view, gap_mm
from lfsr_core.optics.rays import CameraArray, RayLayout, flip_order, to_views, view_offset
from tests.support.card_rays import lens_card_rays, pixel_rays
from tests.support.told import refuses

MINI = load_display("mini")
ARRAY = CameraArray.for_display(MINI, width=MINI.panel_mm[0])  # scene units are millimetres here
NEAR, FAR, PLANE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def painted(*squares):
    """EIA (H, W, 3) in view order of squares (x, y, depth as a fraction of the distance, colour), the nearest last."""
    origin, direction = pixel_rays(RayLayout.for_display(MINI, ARRAY))
    image = np.zeros((*origin.shape[:2], 3), np.float32)
    for x, y, depth, color in squares:
        hit = origin + direction * (depth * ARRAY.distance / direction[..., 2:])
        image[(np.abs(hit[..., 0] - x) < 16) & (np.abs(hit[..., 1] - y) < 16)] = color
    return image


def on_panel(image):
    return flip_order(image, MINI.lenses)


def center(image, color):
    """Mean (column, row) of pixels in which ``color``'s channel is on."""
    rows, columns = np.nonzero(image[..., int(np.argmax(color))] > 0.5)
    assert len(rows), "the square must be in sight"
    return float(columns.mean()), float(rows.mean())


def looking(image, x=0.0, y=0.0, z=None):
    return eye_view(on_panel(image), MINI, (x, y, MINI.viewing_distance_mm if z is None else z), width=0)


def test_an_eye_where_a_camera_stood_sees_its_view_and_beyond_the_zone_it_repeats_one_lens_on():
    image = np.random.default_rng(0).random((96, 128, 3)).astype(np.float32)
    views, offset = to_views(image, MINI.lenses), view_offset(np.arange(8), 8, ARRAY.spacing)
    for row, column in ((0, 0), (2, 5), (7, 7), (3, 0)):
        np.testing.assert_array_equal(looking(image, offset[column], -offset[row]), views[row, column])
    zone, offset = 8 * ARRAY.spacing, view_offset(np.arange(8), 8, ARRAY.spacing)[2]
    inside, outside = looking(image, offset), looking(image, offset + zone)
    np.testing.assert_array_equal(outside[:, 1:], inside[:, :-1])
    assert (outside[:, 0] == 0).all(), "left of the panel there is nothing"


def test_near_things_move_against_the_eye_far_ones_with_it_and_those_on_the_display_stand_still():
    x, y = center(looking(painted((-30, 20, 1.0, PLANE))), PLANE)
    assert x < 5.5 and y < 4, "left is left and up is up"
    image = painted((0, 0, 1.2, FAR), (0, 0, 0.8, NEAR))
    for axis in (0, 1):
        step = [0.0, 0.0]
        step[axis] = 40.0
        before, after = looking(image, -step[0], -step[1]), looking(image, step[0], step[1])
        near, far = (center(after, color)[axis] - center(before, color)[axis] for color in (NEAR, FAR))
        upwards = -1 if axis else 1  # rows count downwards
        assert near * upwards < -1 and far * upwards > 0.5
    image = painted((30, 0, 1.0, PLANE))
    assert np.ptp([center(looking(image, x), PLANE)[0] for x in (-50, 0, 50)]) < 1e-6


def test_a_display_whose_driver_flips_shows_the_same_and_the_gap_gives_the_viewing_angle():
    image, direct = painted((-30, 20, 0.8, NEAR), (20, 0, 1.2, FAR)), dataclasses.replace(MINI, ei_order="direct")
    eye = (25.0, -10.0, MINI.viewing_distance_mm)
    np.testing.assert_array_equal(eye_view(image, direct, eye, width=0), eye_view(on_panel(image), MINI, eye, width=0))
    image = painted((-30, 20, 1.0, PLANE))
    large = eye_view(on_panel(image), MINI, (0, 0, 180), width=100)
    assert large.shape == (12 * 6, 16 * 6, 3)
    np.testing.assert_array_equal(large[::6, ::6], looking(image))
    np.testing.assert_array_equal(large[5::6, 5::6], looking(image))
    assert 2 * np.degrees(np.arctan(MINI.lens_pitch_mm[0] / 2 / gap_mm(MINI))) == pytest.approx(MINI.viewing_angle_deg)
    for wrong in ((0, 0, 0), (np.nan, 0, 180)):
        refuses("the eye is at", eye_view, np.zeros((96, 128, 3)), MINI, wrong)
    refuses("128×90", eye_view, np.zeros((90, 128, 3)), MINI, (0, 0, 180))


PLACES = [(0, 0, 1), (0.6, -0.4, 1), (-0.9, 0.9, 1), (1.7, 0, 1), (0.2, 0.3, 0.5), (-0.5, 0.1, 2.5)]


@pytest.mark.parametrize("order", ["flipped", "direct"])
@pytest.mark.parametrize("place", PLACES)
def test_every_lens_shows_the_ray_of_the_pixel_that_the_eye_sees(order, place):
    profile = dataclasses.replace(load_display("mini"), ei_order=order)
    array = CameraArray.for_display(profile, 2.0)
    layout = RayLayout.for_display(profile, array)
    region, eye = eye_region(profile, (128, 96)), eye_place(profile, *place)
    assert (region.scale, region.profile.views) == (8, (8, 8))
    origins, directions = pixel_rays(layout)
    light = np.concatenate([origins, directions, np.ones_like(origins[..., :1])], axis=-1)   # a ray is its own colour
    on_panel = flip_order(light, profile.lenses) if order == "flipped" else light
    wanted = eye_view(on_panel, profile, eye, width=profile.lenses[0]).reshape(-1, 7)
    card = eye_card(layout, profile, eye, region)
    origin, direction = lens_card_rays(card, card.cells.mean(1), card.targets, array.distance)
    shown = wanted[:, 6] > 0
    assert shown.any() and len(card.cells) == shown.sum(), "beyond the panel nothing is seen"
    assert np.allclose(origin, wanted[shown, :3]) and np.allclose(direction, wanted[shown, 3:6])


def test_a_lens_is_of_many_pixels_and_smaller_ones_where_large_ones_leave_too_much_empty():
    profile = load_display("mini")
    layout = RayLayout.for_display(profile, CameraArray.for_display(profile, 2.0), 4)
    region = eye_region(profile, (300, 200))
    assert (region.scale, region.profile.views) == (8, (16, 16)) and region.profile.panel_pixels == (256, 192)
    card = eye_card(layout, profile, eye_place(profile, 0.3, 0.3, 1), region)
    assert len(card.cells) == 16 * 12 * 4 and len(np.unique(card.targets, axis=0)) == 16 * 12
    assert {tuple(cell) for cell in np.floor(card.cells).reshape(-1, 2)} == {(1, 0)}, "right of the middle and above"
    region = eye_region(load_display("mini"), (16 * 23, 500))
    assert (region.scale, region.profile.views) == (4, (20, 20))
    refuses("make the window larger", eye_region, load_display("mini"), (15, 500))
