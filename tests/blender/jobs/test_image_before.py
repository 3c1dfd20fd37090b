"""The test image shows the same as the image, and is small."""

import math

import pytest

from blender_addon.jobs import asked
from blender_addon.scene import settings as scene_settings
from lfsr_core.optics.display import builtin_names, load_display


@pytest.mark.parametrize("name", builtin_names())
def test_a_test_image_has_the_displays_shape_and_few_pixels(name):
    display = load_display(name)
    small = asked.reduced_display(display)
    assert small.panel_mm[0] / small.panel_mm[1] == pytest.approx(display.panel_mm[0] / display.panel_mm[1], rel=0.02)
    assert math.prod(small.eia_pixels) <= min(math.prod(display.eia_pixels), 10**6)
    assert (small.viewing_distance_mm, small.viewing_angle_deg) == (
        display.viewing_distance_mm, display.viewing_angle_deg)
    assert all(new >= min(old, asked.LEAST_VIEWS) for new, old in zip(small.views, display.views, strict=True))


@pytest.mark.parametrize("scale", ["AUTO", "1", "5"])
def test_the_settings_of_a_test_image_go_together(artist, scale):
    artist.lfsr.display, artist.lfsr.scale, artist.lfsr.method = "bupt-32in-8k", scale, "denoise+bilinear"
    small = asked.reduced(scene_settings.resolve(artist))
    assert small.display.lenses == (96, 54) and bool(small.sampling.scales) == (scale == "AUTO")
    small.method.check_scale(small.sampling.scale)


def test_small_images_need_no_test_image(artist):
    assert asked.reduced(scene_settings.resolve(artist)) is None
