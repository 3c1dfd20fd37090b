"""The world by direction, against the rays themselves."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.optics.display import load_display
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.optics.rays import CameraArray, RayLayout, rays
from lfsr_core.optics.world_view import WorldImage, WorldView
from tests.support.synthetic import FLAT, MINI

HALF = dataclasses.replace(MINI, name="half", lenses=(8, 6), panel_pixels=(64, 48), panel_mm=(64.0, 48.0))
LAYOUTS = {"centred": {}, "paper": {"convention": "paper"}, "points": {"view_aperture": 0.0}}


def layout_of(display=MINI, scale=1, **options):
    return RayLayout.for_display(display, CameraArray.for_display(display, 2.0), scale, **options)


def look(right, down):
    """A world with detail, by slope."""
    return np.stack([np.sin(9 * right + 2 * down), np.cos(6 * down), (right > 0.1) * 1.0 + down], -1) + 2


def world_image(layout):
    """What Blender renders: mean light of every pixel."""
    image = WorldImage.of(layout)
    right, down = (((np.arange(4 * count) + 0.5) / (4 * count) * 2 - 1) * reach
                   for count, reach in zip(image.size, image.reach, strict=True))
    fine = look(*np.meshgrid(right, down))
    return fine.reshape(image.size[1], 4, image.size[0], 4, 3).mean((1, 3))


def ray_slopes(layout, seed):
    """Slopes, rightwards and downwards, of a random ray of every pixel."""
    random, (width, height) = np.random.default_rng(seed), layout.size
    places = random.random((4, height, width))
    x, y = (np.arange(width) + places[0]) / width, 1 - (np.arange(height)[:, None] + places[1]) / height
    _, direction = rays(layout, x, y, places[2], places[3])
    return direction[..., 0] / direction[..., 2], -direction[..., 1] / direction[..., 2]


@pytest.mark.parametrize("display", [HALF, FLAT], ids=["half", "flat"])
@pytest.mark.parametrize("options", LAYOUTS.values(), ids=LAYOUTS)
def test_pixels_see_the_mean_of_their_rays(display, options):
    layout = layout_of(display, **options)
    image = WorldImage.of(layout)
    drawn, count = 0.0, 100
    for seed in range(count):
        right, down = ray_slopes(layout, seed)
        assert np.abs(right).max() < image.reach[0] and np.abs(down).max() < image.reach[1]
        drawn = drawn + look(right, down) / count
    lenses = np.argwhere(np.ones(layout.lenses[::-1], bool))[::5]
    seen = WorldView.of(layout, world_image(layout)).elemental_images(lenses)
    expected = to_elemental_images(drawn, layout.lenses)[tuple(lenses.T)]
    smooth, edge = np.abs(seen - expected)[..., :2], np.abs(seen - expected)[..., 2]
    assert smooth.mean() < 0.02 and smooth.max() < 0.16
    assert edge.mean() < 0.015 and edge.max() < 0.35, "of a step of 1, with the noise of 100 rays"


def test_lenses_in_any_order_or_tiles_see_the_same_small_image():
    layout = layout_of()
    view = WorldView.of(layout, world_image(layout))
    lenses = np.random.default_rng(1).integers(0, layout.lenses[::-1], (20, 2))
    each = [view.elemental_images(lens[None])[0] for lens in lenses]
    np.testing.assert_array_equal(view.elemental_images(lenses), each)
    listed = ((3, 5), (0, 15), (11, 0), (4, 4), (7, 2))
    layout = layout_of(scale=2, lens_list=listed)
    shown = layout.shown_lenses.reshape(-1, 2)
    assert [tuple(place) for place in shown[:5]] == list(listed) and (shown[5:] == listed[-1]).all()
    assert (layout_of().shown_lenses.reshape(-1, 2) == np.argwhere(np.ones((12, 16)))).all()
    # An 8K light field sees no more of the world than a small image holds.
    layout = layout_of(load_display("bupt-32in-8k"))
    assert np.prod(WorldImage.of(layout).size) < 1e6
    tiny = dataclasses.replace(layout, array=dataclasses.replace(layout.array, spacing=1e-9), spacing=1e-9)
    assert max(WorldImage.of(tiny).size) <= 4096
