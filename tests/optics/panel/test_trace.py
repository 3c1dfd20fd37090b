"""The simulated eye before a panel with a lens sheet sees the right view from the right place."""

import numpy as np
import pytest

from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.panel.subpixel_rays import Geometry
from lfsr_core.optics.panel.weave import gather_map, weave
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


@pytest.mark.parametrize(("eye", "told"), [((0, 0, 0), "z = 0 mm"), ((0, 0, -5), "z = -5 mm")])
def test_an_eye_behind_the_panel_is_refused(eye, told):
    refuses(told, eye_view, np.zeros((160, 240, 3), np.uint8), lenticular(), eye)


def test_another_image_is_refused():
    refuses("240×159 pixels.*240×160", eye_view, np.zeros((159, 240, 3), np.uint8), lenticular(), (0, 0, 300))
