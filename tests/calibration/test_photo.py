"""Photographs as telephones and programs store them."""

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps

from lfsr_core.calibration.photograph import LONGER_SIDE, read_photograph
from tests.support.told import refuses

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
    np.testing.assert_allclose(read_photograph(path), expected, atol=0.02)


def test_deep_and_transparent_pictures_are_read(tmp_path):
    Image.fromarray(np.dstack([QUARTERS, np.full((40, 60), 255, np.uint8)])).save(tmp_path / "alpha.png")
    np.testing.assert_allclose(read_photograph(tmp_path / "alpha.png"), QUARTERS / 255, atol=1e-6)
    cv2.imwrite(str(tmp_path / "deep.png"), QUARTERS[..., ::-1].astype(np.uint16) * 257)
    np.testing.assert_allclose(read_photograph(tmp_path / "deep.png"), QUARTERS / 255, atol=1e-6)


def test_large_pictures_are_averaged(tmp_path):
    wide = np.zeros((4, 2 * LONGER_SIDE, 3), np.uint8)
    wide[:, 1::2] = 200
    Image.fromarray(wide).save(tmp_path / "wide.png")
    read = read_photograph(tmp_path / "wide.png")
    assert read.shape == (2, LONGER_SIDE, 3)
    np.testing.assert_allclose(read, 100 / 255, atol=1e-6)


@pytest.mark.parametrize(("picture", "told"), [
    (Image.new("L", (300, 300)), "has no colours"), (Image.new("1", (300, 300)), "has no colours"),
    (Image.new("RGB", (11000, 11000)), "may have 120 million")])
def test_what_is_no_photograph_in_colour_is_refused(tmp_path, picture, told):
    picture.save(tmp_path / "photo.png")
    refuses(told, read_photograph, tmp_path / "photo.png")


@pytest.mark.parametrize("content", [b"", b"\xff\xd8\xff\xe0", b"text" * 100])
def test_what_is_no_picture_is_refused(tmp_path, content):
    (tmp_path / "photo.jpg").write_bytes(content)
    refuses("photo.jpg cannot be read as a photograph", read_photograph, tmp_path / "photo.jpg")
