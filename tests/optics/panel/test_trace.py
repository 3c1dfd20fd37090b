"""Rays of subpixels, and the simulated eye before a panel with a lens sheet, which sees the right view."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.panel.subpixel_rays import (
    Geometry,
    PanelLayout,
    lens_points,
    panel_image,
    panel_rays,
    subpixel_rays,
)
from lfsr_core.optics.panel.trace import trace
from lfsr_core.optics.panel.weave import gather_map, weave
from lfsr_core.optics.rays import CameraArray
from tests.support.panels import SHEETS, lenticular, whole
from tests.support.synthetic import MINI
from tests.support.told import refuses


def numbered(display, axis):
    """EIA whose value is the number of the view along ``axis`` (0 across, 1 down), times 8."""
    columns, rows = display.eia_pixels
    size, count = ((columns, rows)[axis], display.views[axis])
    values = (np.arange(size) % count * 8).astype(np.uint8)
    values = values[None, :, None] if axis == 0 else values[:, None, None]
    return np.broadcast_to(values, (rows, columns, 3))


def eye_of_view(display, view_x, view_y=None):
    geometry, (px, py) = Geometry.of(display), display.views
    down = (py - 1) / 2 if view_y is None else view_y
    return ((view_x - (px - 1) / 2) * geometry.spacing, -(down - (py - 1) / 2) * geometry.spacing, geometry.distance)


def looks(display, eia, eye):
    """Without the panel's border, beyond which an eye at the side looks."""
    return eye_view(weave(eia, gather_map(display, "nearest")), display, eye, width=1)[2:-2, 2:-2].astype(float)


@pytest.mark.parametrize("sheet", SHEETS)
def test_an_eye_at_the_centre_of_a_view_sees_that_view(sheet):
    display = SHEETS[sheet]()
    for axis in (0, 1) if display.views[1] > 1 else (0,):
        eia, count = numbered(display, axis), display.views[axis]
        for view in (count // 4, count // 2, 3 * count // 4):
            eye = eye_of_view(display, view) if axis == 0 else eye_of_view(display, (display.views[0] - 1) / 2, view)
            seen = looks(display, eia, eye) / 8
            assert np.median(seen) == pytest.approx(view, abs=0.5)
            assert np.percentile(np.abs(seen - view), 90) < 1.5


def test_whole_numbers_are_seen_as_a_profile_of_format_1_is():
    display = whole("lenslet", subpixels={"stripes": "white"})
    eia = np.random.default_rng(0).integers(0, 256, (96, 128, 3), np.uint8)
    panel = weave(eia, gather_map(display, "views"))
    for view in ((0, 0), (2, 5), (7, 7)):
        eye = eye_of_view(display, *view)
        np.testing.assert_array_equal(eye_view(panel, display, eye, width=1), eye_view(panel, MINI, eye, width=1))


def test_an_eye_that_moves_on_by_the_zone_sees_the_views_again():
    display = lenticular()
    eia, zone = numbered(display, 0), display.views[0] * Geometry.of(display).spacing
    eye = eye_of_view(display, 5)
    first, again = (looks(display, eia, (eye[0] + step, eye[1], eye[2])) for step in (0, zone))
    assert np.median(first) == pytest.approx(np.median(again), abs=8)


def test_an_eye_behind_the_panel_and_another_image_are_refused():
    for z in (0, -5):
        refuses(f"z = {z} mm", eye_view, np.zeros((160, 240, 3), np.uint8), lenticular(), (0, 0, z))
    refuses("240×159 pixels.*240×160", eye_view, np.zeros((159, 240, 3), np.uint8), lenticular(), (0, 0, 300))
    refuses("'mini' has no lens sheet", PanelLayout, MINI, CameraArray.for_display(MINI, 2.0))


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
