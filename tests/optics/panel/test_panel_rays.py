"""Rays of subpixels: those of the light field where the weave takes a value, and an eye's, backwards."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.optics.panel.subpixel_rays import (
    Geometry,
    PanelLayout,
    lens_points,
    panel_image,
    panel_rays,
    subpixel_rays,
)
from lfsr_core.optics.panel.trace import trace
from lfsr_core.optics.rays import CameraArray
from tests.support.panels import SHEETS, lenticular
from tests.support.synthetic import MINI
from tests.support.told import refuses

LENTICULAR = lenticular(subpixels={"stripes": "bgr"})
MIRRORED = dataclasses.replace(LENTICULAR, lenticular=dataclasses.replace(LENTICULAR.lenticular, flip=(True, True)))
DISPLAYS = {**{name: make() for name, make in SHEETS.items()}, "mirrored": MIRRORED,
            "white": lenticular(subpixels={"stripes": "white"})}


def layout_of(name):
    return PanelLayout(DISPLAYS[name], CameraArray.for_display(DISPLAYS[name], 2.0))


def rays_of(layout, random=None):
    """In the middle of subpixels and lenses, or at random places; ends on the camera and on the display plane."""
    (width, height), (in_x, in_y, *pair) = layout.size, [0.5] * 4 if random is None else random
    raster = np.broadcast_arrays((np.arange(width) + in_x) / width, 1 - (np.arange(height)[:, None] + in_y) / height)
    origin, direction = panel_rays(layout, *raster, *pair)
    return origin, origin + direction / direction[..., 2:] * layout.array.distance


@pytest.mark.parametrize("name", DISPLAYS)
def test_a_subpixels_ray_is_the_one_that_the_weave_looks_for(name):
    layout = layout_of(name)
    display, array = layout.display, layout.array
    origin, target = rays_of(layout)
    x, y, eye = (panel_image(layout, np.repeat(values[..., None], 3, -1))
                 for values in (target[..., 0], target[..., 1], origin[..., 0]))
    rows, columns = np.arange(display.panel_pixels[1])[:, None], np.arange(display.panel_pixels[0])
    for channel in range(3):
        rays = subpixel_rays(display, channel, rows, columns)
        np.testing.assert_allclose(x[..., channel] / array.half_width,
                                   (rays.column + 0.5) / display.lenses[0] * 2 - 1, atol=1e-9)
        np.testing.assert_allclose(y[..., channel] / array.half_height,
                                   1 - (rays.row + 0.5) / display.lenses[1] * 2, atol=1e-9)
        np.testing.assert_allclose(eye[..., channel] / array.spacing,
                                   rays.view_x + 0.5 - display.views[0] / 2, atol=1e-9)


@pytest.mark.parametrize("name", DISPLAYS)
def test_an_eye_where_a_ray_arrives_sees_the_subpixel_that_sent_it(name):
    layout = layout_of(name)
    geometry, (width, height) = Geometry.of(layout.display), layout.size
    random = np.random.default_rng(0)
    places = tuple(random.uniform(0.1, 0.9, 4))
    origin, target = rays_of(layout, places)
    millimetres = np.array(geometry.lens_plane) / 2 / (layout.array.half_width, layout.array.half_height)
    sent = panel_image(layout, np.repeat(np.arange(width * height).reshape(height, width, 1), 3, -1))
    for row, index in random.integers(0, (height, width), (60, 2)):
        eye = (*origin[row, index, :2] / layout.array.spacing * geometry.spacing, geometry.distance)
        seen = trace(layout.display, eye, *(target[row, index, :2] * millimetres))
        if seen.on_panel:
            assert sent[seen.row, seen.column, max(seen.channel, 0)] == row * width + index


@pytest.mark.parametrize("name", ["lenticular", "hexagonal", "square"])
def test_points_on_a_lens_are_even_around_its_middle_and_its_own(name):
    display, random = DISPLAYS[name], np.random.default_rng(1).random((2, 4000))
    x, y = lens_points(display, *random)
    assert abs(x.mean()) < 0.02 * x.std() + 0.05 and abs(y.mean()) < 0.02 * y.std() + 0.05
    if display.lenticular:
        assert np.hypot(x, y).max() < display.lenticular.pitch_mm / 2
        return
    matrix = display.lenslet.lenses.matrix(display.lenslet.packing)
    steps = [matrix @ (one, two) for one in (-1, 0, 1) for two in (-1, 0, 1) if one or two]
    assert all((np.hypot(x, y) <= np.hypot(x - right, y - up) + 1e-9).all() for right, up in steps)


def test_a_display_without_a_sheet_has_no_rays_of_its_own():
    refuses("'mini' has no lens sheet", PanelLayout, MINI, CameraArray.for_display(MINI, 2.0))
