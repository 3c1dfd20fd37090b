"""Patterns, photographs as telephones store them, and what simulated ones tell of a sheet."""

import dataclasses
import functools
import math
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps

from lfsr_core.base.messages import LfsrError
from lfsr_core.calibration.fit import Calibration, combine, comparison, see
from lfsr_core.calibration.patterns import PATTERNS, pattern
from lfsr_core.calibration.photograph import LONGER_SIDE, find_panel, read_photograph
from lfsr_core.exports.importing import image_size, read_image
from lfsr_core.optics.display import DisplayProfile, Lattice, load_display
from lfsr_core.optics.eye import eye_view
from tests.support.panels import SHEETS
from tests.support.telephone import Shot, photograph
from tests.support.told import refuses

PIXEL = 0.25
LARGE = {"format": 2, "name": "large", "panel_pixels": [960, 540], "panel_mm": [240.0, 135.0],
         "viewing_distance_mm": 500.0, "viewing_angle_deg": 40.0}
CYLINDERS = DisplayProfile.from_dict(LARGE | {"lenticular": {"pitch_mm": 1.6, "slant": -0.15, "center": 0.3}})
LENSES = DisplayProfile.from_dict(LARGE | {"lenslet": {
    "packing": "hexagonal", "gap_mm": 2.75, "lenses": {"pitch_mm": [2.0, 2.0 * math.sqrt(0.75)]}}})
PLACE = (30.0, -20.0, 520.0)
GOOD = Shot(PLACE, (900, 640), roll_deg=2.0, aim=(0.02, -0.03), noise=0.004, rays=1)


class Photograph(NamedTuple):
    image: np.ndarray
    eye_mm: tuple[float, float, float]


@functools.cache
def taken(nominal=CYLINDERS, real=None, **changes) -> Photograph:
    """A photograph of the phase pattern of ``nominal`` through the sheet of ``real``; changes of GOOD."""
    shot = dataclasses.replace(GOOD, **changes)
    return Photograph(photograph(pattern(nominal, "phase"), real or nominal, shot).astype(np.float32), shot.eye_mm)


def fit_profile(profile: DisplayProfile, photographs: list[Photograph]) -> Calibration:
    return combine(profile, [see(profile, *photograph) for photograph in photographs])


def changed(**changes) -> Photograph:
    return taken()._replace(**changes)


@pytest.mark.parametrize(("pitch", "slant", "center"), [(1.6064, -0.156, 0.55)])
def test_cylinders_are_found(pitch, slant, center):
    real = dataclasses.replace(CYLINDERS, lenticular=dataclasses.replace(
        CYLINDERS.lenticular, pitch_mm=pitch, slant=slant, center=center))
    fitted = fit_profile(CYLINDERS, [taken(real=real)]).profile.lenticular
    assert fitted.pitch_mm == pytest.approx(pitch, rel=1e-5) and fitted.slant == pytest.approx(slant, abs=1e-4)

    def middle(sheet):  # phase at the panel's middle, where errors of pitch and slant weigh least
        return sheet.lenses_across(240.0) / 2 * (1 + sheet.slant * 135 / 240) - sheet.center

    assert ((middle(fitted) - middle(real.lenticular) + 0.5) % 1 - 0.5) * pitch / PIXEL == pytest.approx(0, abs=0.03)


def test_small_lenses_are_found_by_two_photographs():
    pitch = (2.01, 2.0 * math.sqrt(0.75) * 0.997)
    real = dataclasses.replace(LENSES, lenslet=dataclasses.replace(
        LENSES.lenslet, lenses=Lattice(pitch, 0.3, 0.002, (0.5, -0.4))))
    photographs = [taken(LENSES, real, eye_mm=eye, size=(1400, 992), noise=0.002)
                   for eye in ((30.0, -20.0, 520.0), (-40.0, 20.0, 480.0))]
    both = fit_profile(LENSES, photographs)
    fitted = both.profile.lenslet.lenses
    # Only 78 rows of lenses: 2.5e-5 is a thousandth of one.
    assert fitted.pitch_mm == pytest.approx(pitch, rel=2.5e-5)
    assert math.radians(fitted.rotation_deg - 0.3) == pytest.approx(0, abs=1e-4)
    assert np.abs(np.subtract(fitted.shift_mm, (0.5, -0.4))).max() / PIXEL < 0.05
    assert 0 < both.errors[0] < 2e-5 and len(both.seen) == 2


@pytest.mark.parametrize(("turns", "mirrored"), [(1, False), (2, False), (3, True),
                                                 *(pytest.param(*case, marks=pytest.mark.long) for case in (
                                                     (0, False), (3, False), (0, True), (1, True), (2, True)))])
def test_a_turned_or_mirrored_photograph_is_recognised(turns, mirrored):
    image = taken().image
    view = find_panel(np.ascontiguousarray(np.rot90(image[:, ::-1] if mirrored else image, -turns)), CYLINDERS)
    assert (view.mirrored, view.turn_deg) == (mirrored, turns * 90)
    # The pattern's corners are where they were, wherever the photograph has them now.
    corners = np.array([[-120, 67.5], [120, 67.5], [120, -67.5]])
    lengths = [np.linalg.norm(np.diff(one.places(corners), axis=0), axis=1)
               for one in (view, find_panel(image, CYLINDERS))]
    np.testing.assert_allclose(*lengths, rtol=2e-4)


def test_a_lens_that_distorts_is_corrected_and_the_prediction_resembles_its_own_sheets_photograph():
    fitted = fit_profile(CYLINDERS, [taken(bend=(0.06, 0.01))])
    assert fitted.seen[0].view.bent == pytest.approx(-0.06, abs=0.02)
    assert fitted.profile.lenticular.pitch_mm == pytest.approx(1.6, rel=1e-5)
    fitted = fit_profile(CYLINDERS, [taken()])
    picture = comparison(CYLINDERS, fitted)
    left, right = picture[:, :720].astype(float), picture[:, -720:].astype(float)
    assert picture.shape[1] > 1440 and picture.dtype == np.uint8
    for channel in range(3):
        assert np.corrcoef(left[..., channel].ravel(), right[..., channel].ravel())[0, 1] > 0.75
    other = dataclasses.replace(fitted.profile.lenticular, pitch_mm=1.62)
    wrong = dataclasses.replace(fitted, profile=dataclasses.replace(fitted.profile, lenticular=other))
    refuses("agree by", comparison, CYLINDERS, wrong)


def test_what_photographs_contradict_is_refused():
    second = taken(eye_mm=(60.0, 0.0, 500.0))._replace(eye_mm=(90.0, 0.0, 500.0))
    refuses("photographs disagree by 0.0|photographs disagree by 0.1", fit_profile, CYLINDERS, [taken(), second])
    blurred = cv2.GaussianBlur(taken().image, (0, 0), 16.0)
    refuses("the pitch is known only to", fit_profile, CYLINDERS, [changed(image=blurred)])
    refuses("z = -3", fit_profile, CYLINDERS, [Photograph(np.zeros((9, 9, 3)), (0.0, 0.0, -3.0))])
    refuses("pattern is 'moire'.*phase, lens, band, rgb, grid", pattern, CYLINDERS, "moire")
    refuses("'mini' has no lens sheet", pattern, load_display("mini"), "phase")
    for place in [(-60.0, -20.0, 520.0), (30.0, 90.0, 520.0)]:
        with pytest.raises(LfsrError, match=r"taken from about (29|30|31|32|28),-(19|20|21|18|22) by its perspective"):
            fit_profile(CYLINDERS, [changed(eye_mm=place)])
    for kind in ["band", "rgb", "grid"]:
        shown = photograph(pattern(CYLINDERS, kind), CYLINDERS, dataclasses.replace(GOOD, size=(600, 427)))
        refuses("dots are not|no colours|overexposed|no lit panel|too dark", fit_profile, CYLINDERS,
                [changed(image=shown)])


def covered(image):
    """With a finger before its upper right part."""
    rows, columns = np.indices(image.shape[:2])
    return np.where((np.hypot(rows - 210, columns - 640) < 110)[..., None], 0.2, image)


@pytest.mark.parametrize(("image", "told"), [
    (lambda image: image * 0, "no lit panel"),
    (lambda image: np.pad(image[::12, ::12], ((300, 300), (400, 400), (0, 0))), "lit panel|shortest side"),
    (lambda image: image[::8, ::8], "needs at least 200"),
    (lambda image: image * 0 + np.pad(np.full((400, 600, 1), 0.6), ((120, 120), (150, 150), (0, 0))), "no colours"),
    (lambda image: np.clip(image * 1.8, 0, 1), "overexposed"), (lambda image: image * 0.1, "too dark"),
    (lambda image: image.mean(-1, keepdims=True).repeat(3, -1), "no colours"),
    (lambda image: image[:, :560], "dots are not"), (covered, "upper right of the panel shows no fringes|dots are not"),
    (lambda image: np.stack([image[..., 1], image[..., 0], image[..., 2]], -1), "dots are not")])
def test_what_cannot_be_measured_is_refused(image, told):
    refuses(told, fit_profile, CYLINDERS, [changed(image=image(taken().image))])


@pytest.mark.parametrize("factor", [
    1.12, 0.95, pytest.param(0.88, marks=pytest.mark.long), pytest.param(1.05, marks=pytest.mark.long)])
def test_a_pitch_far_from_the_makers_is_refused_or_right(factor):
    real = dataclasses.replace(CYLINDERS, lenticular=dataclasses.replace(CYLINDERS.lenticular, pitch_mm=1.6 * factor))
    try:
        fitted = fit_profile(CYLINDERS, [taken(real=real)])
    except LfsrError:
        return
    assert fitted.profile.lenticular.pitch_mm == pytest.approx(1.6 * factor, rel=1e-5)


@pytest.mark.parametrize("sheet", SHEETS)
@pytest.mark.parametrize("kind", PATTERNS)
def test_every_pattern_on_every_sheet(sheet, kind):
    image = pattern(SHEETS[sheet](), kind)
    assert image.shape == (160, 240, 3) and image.dtype == np.uint8
    assert image.std() > 10


@pytest.mark.parametrize("sheet", SHEETS)
def test_the_band_is_bright_from_the_middle_and_rgb_red_from_the_left(sheet):
    display = SHEETS[sheet]()
    shown = pattern(display, "band")
    middle, side = (eye_view(shown, display, (x, 0.0, 300.0), width=1)[3:-3, 3:-3].mean() for x in (0.0, 60.0))
    assert middle > 150 and side < 30
    for x, channel in ((-70.0, 0), (0.0, 1), (70.0, 2)):
        color = eye_view(pattern(display, "rgb"), display, (x, 0.0, 300.0), width=1)[3:-3, 3:-3].mean((0, 1))
        assert color.argmax() == channel and color.max() > 2 * np.sort(color)[1]


QUARTERS = np.zeros((40, 60, 3), np.uint8)
QUARTERS[:20, :30, 0] = QUARTERS[:20, 30:, 1] = QUARTERS[20:, :30, 2] = 255


@pytest.mark.parametrize("kind", ["png", "jpg"])
@pytest.mark.parametrize("orientation", range(10))
def test_exif_tells_what_is_up(tmp_path, orientation, kind):
    exif = Image.Exif()
    exif[0x0112] = orientation
    path = tmp_path / f"photo.{kind}"
    Image.fromarray(QUARTERS).save(path, exif=exif, quality=100)
    expected = np.asarray(ImageOps.exif_transpose(Image.open(path))) / 255  # Pillow ignores wrong numbers too
    np.testing.assert_allclose([read_photograph(path), read_image(path) / 255], [expected] * 2, atol=0.02)
    assert image_size(path) == expected.shape[1::-1]


def test_pictures_deep_transparent_large_and_none(tmp_path):
    Image.fromarray(np.dstack([QUARTERS, np.full((40, 60), 255, np.uint8)])).save(tmp_path / "alpha.png")
    np.testing.assert_allclose(read_photograph(tmp_path / "alpha.png"), QUARTERS / 255, atol=1e-6)
    cv2.imwrite(str(tmp_path / "deep.png"), QUARTERS[..., ::-1].astype(np.uint16) * 257)
    np.testing.assert_allclose(read_photograph(tmp_path / "deep.png"), QUARTERS / 255, atol=1e-6)
    wide = np.zeros((4, 2 * LONGER_SIDE, 3), np.uint8)
    wide[:, 1::2] = 200
    Image.fromarray(wide).save(tmp_path / "wide.png")
    read = read_photograph(tmp_path / "wide.png")
    assert read.shape == (2, LONGER_SIDE, 3)
    np.testing.assert_allclose(read, 100 / 255, atol=1e-6)
    for picture, told in [
        (Image.new("L", (300, 300)), "has no colours"), (Image.new("1", (300, 300)), "has no colours"),
        (Image.new("1", (11000, 11000)), "may have 120 million")]:
        picture.save(tmp_path / "photo.png")
        refuses(told, read_photograph, tmp_path / "photo.png")
    for content in [b"", b"\xff\xd8\xff\xe0", b"text" * 100]:
        (tmp_path / "photo.jpg").write_bytes(content)
        refuses("photo.jpg cannot be read as a photograph", read_photograph, tmp_path / "photo.jpg")
