"""Patterns, and what simulated photographs of them tell of a sheet: perspective, blur, noise, eight bits."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.panel.fit import Photograph, fit_profile
from lfsr_core.optics.panel.patterns import PATTERNS, pattern
from lfsr_core.optics.panel.photograph import fit_homography, project
from lfsr_core.optics.sheet import Lattice
from tests.support.panels import SHEETS
from tests.support.photographs import photograph

PIXEL = 0.25
LARGE = {"format": 2, "name": "large", "panel_pixels": [960, 540], "panel_mm": [240.0, 135.0],
         "viewing_distance_mm": 500.0, "viewing_angle_deg": 40.0}
CYLINDERS = DisplayProfile.from_dict(LARGE | {"lenticular": {"pitch_mm": 1.6, "slant": -0.15, "center": 0.3}})
LENSES = DisplayProfile.from_dict(LARGE | {"lenslet": {
    "packing": "hexagonal", "lenses": {"pitch_mm": [4.0, 4.0 * math.sqrt(0.75)]}}})


def photographs(nominal, real, *eyes):
    shown = pattern(nominal, "phase")
    return [Photograph(photograph(shown, real, eye, seed=number), eye) for number, eye in enumerate(eyes)]


@pytest.mark.parametrize(("pitch", "slant", "center"), [(1.6064, -0.156, 0.55)])
def test_cylinders_are_found(pitch, slant, center):
    real = dataclasses.replace(CYLINDERS, lenticular=dataclasses.replace(
        CYLINDERS.lenticular, pitch_mm=pitch, slant=slant, center=center))
    found = fit_profile(CYLINDERS, photographs(CYLINDERS, real, (30.0, -20.0, 520.0))).lenticular
    assert found.pitch_mm == pytest.approx(pitch, rel=1e-4)
    assert math.degrees(math.atan(found.slant) - math.atan(slant)) == pytest.approx(0, abs=0.01)

    def middle(sheet):  # phase at the panel's middle, where errors of pitch and slant weigh least
        return sheet.lenses_across(240.0) / 2 * (1 + sheet.slant * 135 / 240) - sheet.center

    shift = (middle(found) - middle(real.lenticular) + 0.5) % 1 - 0.5
    assert shift * pitch / PIXEL == pytest.approx(0, abs=0.1)


def test_small_lenses_are_found():
    pitch = (4.02, 4.0 * math.sqrt(0.75) * 0.997)
    real = dataclasses.replace(LENSES, lenslet=dataclasses.replace(
        LENSES.lenslet, lenses=Lattice(pitch, 0.3, 0.002, (0.5, -0.4))))
    found = fit_profile(LENSES, photographs(LENSES, real, (0.0, 0.0, 500.0), (40.0, 20.0, 480.0))).lenslet.lenses
    # Only 34 rows of lenses: a ten thousandth is a third of a percent of one.
    assert found.pitch_mm == pytest.approx(pitch, rel=1.5e-4)
    assert found.rotation_deg == pytest.approx(0.3, abs=0.01)
    assert np.abs(np.subtract(found.shift_mm, (0.5, -0.4))).max() / PIXEL < 0.1


def test_photographs_from_other_places_than_said_disagree():
    first, second = photographs(CYLINDERS, CYLINDERS, (0.0, 0.0, 500.0), (60.0, 0.0, 500.0))
    with pytest.raises(LfsrError, match="photographs disagree by 0.1"):
        fit_profile(CYLINDERS, [first, dataclasses.replace(second, eye_mm=(100.0, 0.0, 500.0))])


@pytest.mark.parametrize(("image", "told"), [
    (np.zeros((600, 800, 3)), "no lit panel"),
    (np.pad(np.ones((60, 80, 3)), ((270, 270), (360, 360), (0, 0))), "lit panel|shortest side"),
    (np.pad(np.ones((400, 600, 3)), ((100, 100), (100, 100), (0, 0))), "dots"),
])
def test_what_shows_no_pattern_is_refused(image, told):
    with pytest.raises(LfsrError, match=told):
        fit_profile(CYLINDERS, [Photograph(image, (0.0, 0.0, 500.0))])


def test_another_pattern_is_refused():
    shown = photograph(pattern(CYLINDERS, "phase") * np.array([0, 0, 1], np.uint8), CYLINDERS, (0.0, 0.0, 500.0))
    with pytest.raises(LfsrError, match="no clear fringes"):
        fit_profile(CYLINDERS, [Photograph(shown, (0.0, 0.0, 500.0))])


def test_a_camera_behind_the_panel_is_refused():
    with pytest.raises(LfsrError, match="z = -3"):
        fit_profile(CYLINDERS, [Photograph(np.zeros((9, 9, 3)), (0.0, 0.0, -3.0))])


def test_a_homography_is_found_again():
    matrix = np.array([[2.0, 0.1, 30], [-0.2, 1.8, 40], [1e-3, -2e-3, 1]])
    points = np.random.default_rng(0).uniform(-50, 50, (9, 2))
    np.testing.assert_allclose(fit_homography(points, project(matrix, points)), matrix, rtol=1e-6)


@pytest.mark.parametrize("sheet", SHEETS)
@pytest.mark.parametrize("kind", PATTERNS)
def test_every_pattern_on_every_sheet(sheet, kind):
    image = pattern(SHEETS[sheet](), kind)
    assert image.shape == (160, 240, 3) and image.dtype == np.uint8
    assert image.std() > 10


@pytest.mark.parametrize("sheet", SHEETS)
def test_the_band_is_bright_from_the_middle_and_dark_from_the_side(sheet):
    display = SHEETS[sheet]()
    shown = pattern(display, "band")
    middle, side = (eye_view(shown, display, (x, 0.0, 300.0), width=1)[3:-3, 3:-3].mean() for x in (0.0, 60.0))
    assert middle > 150 and side < 30


@pytest.mark.parametrize("sheet", SHEETS)
def test_rgb_is_red_from_the_left_and_blue_from_the_right(sheet):
    display = SHEETS[sheet]()
    for x, channel in ((-70.0, 0), (0.0, 1), (70.0, 2)):
        color = eye_view(pattern(display, "rgb"), display, (x, 0.0, 300.0), width=1)[3:-3, 3:-3].mean((0, 1))
        assert color.argmax() == channel and color.max() > 2 * np.sort(color)[1]


def test_wrong_patterns_and_displays_are_named():
    with pytest.raises(LfsrError, match="pattern is 'moire'.*phase, lens, band, rgb, grid"):
        pattern(CYLINDERS, "moire")
    with pytest.raises(LfsrError, match="'mini' has no lens sheet"):
        pattern(load_display("mini"), "phase")
