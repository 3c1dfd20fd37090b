"""PNG images: lossless, small, whole."""

import zlib

import numpy as np
import pytest
from PIL import Image

from lfsr_core.images import png
from tests.support.told import refuses

RANDOM = np.random.default_rng(0)


@pytest.mark.parametrize("shape", [(1, 1, 3), (63, 5, 3), (64, 7, 3), (65, 6, 3), (200, 33, 3), (54, 96)])
def test_png_is_lossless_and_readable_by_another_library(tmp_path, shape):
    pixels = RANDOM.integers(0, 256, shape, dtype=np.uint8)
    png.write_png(tmp_path / "a.png", pixels)
    with Image.open(tmp_path / "a.png") as image:
        image.verify()  # checks every chunk's checksum
    with Image.open(tmp_path / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image), pixels)
    if len(shape) == 3:
        np.testing.assert_array_equal(png.read_png(tmp_path / "a.png"), pixels)


def test_png_stream_has_the_right_adler_checksum():
    pixels = RANDOM.integers(0, 256, (300, 21, 3), dtype=np.uint8)
    parts = png.encode_png(pixels)
    stream = b"".join(part[8:-4] for part in parts if part[4:8] == b"IDAT")
    assert len(zlib.decompress(stream)) == 300 * (21 * 3 + 1)  # raises where the checksum is wrong


def test_flat_images_are_small():
    size = sum(len(part) for part in png.encode_png(np.full((1000, 1000, 3), 77, np.uint8)))
    assert size < 60_000


def test_mask_round_trip(tmp_path):
    mask = RANDOM.random((54, 96)) > 0.5
    png.write_mask(tmp_path / "m.png", mask)
    np.testing.assert_array_equal(png.read_mask(tmp_path / "m.png", (96, 54)), mask)
    refuses("has 96×54 pixels, but the display has 54×96 lenses", png.read_mask, tmp_path / "m.png", (54, 96))


def test_unreadable_png(tmp_path):
    (tmp_path / "a.png").write_bytes(b"not an image")
    refuses("not a readable", png.read_png, tmp_path / "a.png")
    refuses("does not exist, expected a PNG image", png.read_mask, tmp_path / "b.png")
