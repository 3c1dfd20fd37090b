"""An eye's card against the simulated eye: the same light field, seen from the same place."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.optics.display import load_display
from lfsr_core.optics.eia import flip_order
from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.eye_card import eye_card, eye_place, eye_region
from lfsr_core.optics.lens_card import card_rays
from lfsr_core.optics.rays import CameraArray, RayLayout
from tests.support.rays import pixel_rays
from tests.support.told import refuses

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
    origin, direction = card_rays(card, card.cells.mean(1), card.targets, array.distance)
    shown = wanted[:, 6] > 0
    assert shown.any() and len(card.cells) == shown.sum(), "beyond the panel nothing is seen"
    assert np.allclose(origin, wanted[shown, :3]) and np.allclose(direction, wanted[shown, 3:6])


def test_scale_shows_the_rendered_view_and_a_lens_is_of_many_pixels():
    profile = load_display("mini")
    layout = RayLayout.for_display(profile, CameraArray.for_display(profile, 2.0), 4)
    region = eye_region(profile, (300, 200))
    assert (region.scale, region.profile.views) == (8, (16, 16)) and region.profile.panel_pixels == (256, 192)
    card = eye_card(layout, profile, eye_place(profile, 0.3, 0.3, 1), region)
    assert len(card.cells) == 16 * 12 * 4 and len(np.unique(card.targets, axis=0)) == 16 * 12
    assert {tuple(cell) for cell in np.floor(card.cells).reshape(-1, 2)} == {(1, 0)}, "right of the middle and above"


def test_smaller_pixels_where_large_ones_leave_too_much_empty():
    region = eye_region(load_display("mini"), (16 * 23, 500))
    assert (region.scale, region.profile.views) == (4, (20, 20))
    refuses("make the window larger", eye_region, load_display("mini"), (15, 500))
