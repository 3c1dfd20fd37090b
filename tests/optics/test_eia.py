"""EIA, elemental images, views and EPIs are the same pixels in another order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics import eia
from tests.support.told import refuses

SIZES = st.tuples(*[st.integers(1, 6)] * 4, st.integers(1, 4))


def image_of(sx: int, sy: int, px: int, py: int, channels: int) -> np.ndarray:
    """An EIA in which every value is different."""
    return np.arange(sy * py * sx * px * channels).reshape(sy * py, sx * px, channels)


@given(SIZES)
def test_elemental_images_without_a_copy_and_views_round_trip(size):
    image = image_of(*size)
    parts = eia.to_elemental_images(image, size[:2])
    assert parts.shape == (size[1], size[0], size[3], size[2], size[4])
    np.testing.assert_array_equal(eia.from_elemental_images(parts), image)
    assert np.shares_memory(parts, image)
    views = eia.to_views(image, size[:2])
    assert views.shape == (size[3], size[2], size[1], size[0], size[4])
    np.testing.assert_array_equal(eia.from_views(views), image)


@given(SIZES, st.data())
def test_every_order_finds_the_same_pixel(size, data):
    sx, sy, px, py, _ = size
    image = image_of(*size)
    j, i, v, u = (data.draw(st.integers(0, count - 1)) for count in (sy, sx, py, px))
    pixel = image[j * py + v, i * px + u]
    np.testing.assert_array_equal(eia.to_elemental_images(image, (sx, sy))[j, i, v, u], pixel)
    np.testing.assert_array_equal(eia.to_views(image, (sx, sy))[v, u, j, i], pixel)
    np.testing.assert_array_equal(eia.horizontal_epi(image, (sx, sy), j, v)[u, i], pixel)
    np.testing.assert_array_equal(eia.vertical_epi(image, (sx, sy), i, u)[v, j], pixel)


@given(SIZES)
def test_epis_of_all_rows_hold_the_whole_image(size):
    sx, sy, _, py, _ = size
    image = image_of(*size)
    stacked = np.stack([np.stack([eia.horizontal_epi(image, (sx, sy), j, v) for j in range(sy)]) for v in range(py)])
    np.testing.assert_array_equal(eia.from_views(stacked.transpose(0, 2, 1, 3, 4)), image)


@given(SIZES)
def test_flip_reverses_inside_each_lens_and_undoes_itself(size):
    image = image_of(*size)
    flipped = eia.flip_order(image, size[:2])
    np.testing.assert_array_equal(eia.to_elemental_images(flipped, size[:2]),
                                  eia.to_elemental_images(image, size[:2])[:, :, ::-1, ::-1])
    np.testing.assert_array_equal(eia.flip_order(flipped, size[:2]), image)


@pytest.mark.parametrize("image", [np.zeros((10, 10)), np.zeros((10, 11, 3)), np.zeros((11, 10, 3))])
def test_image_that_lenses_do_not_divide_is_refused(image):
    refuses(r"image has shape \(1[01], 1[01].*5 rows and 2 columns", eia.views_per_lens, image, (2, 5))
