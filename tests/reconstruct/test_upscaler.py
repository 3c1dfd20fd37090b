"""Classical upscalers against OpenCV: each elemental image on its own, in the order asked for."""

import cv2
import numpy as np
import pytest

from lfsr_core.metrics.eia_metrics import blur
from lfsr_core.reconstruct.methods import load_method
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_core.reconstruct.upscaler import LowResEIA, decode, encode
from tests.support.told import refuses

FLAGS = {"nearest": cv2.INTER_NEAREST, "bilinear": cv2.INTER_LINEAR, "bicubic": cv2.INTER_CUBIC}
RANDOM = np.random.default_rng(0)


def test_blur_keeps_single_precision_and_none_full_resolution():
    image = np.random.default_rng(1).random((30, 30, 3), dtype=np.float32)
    blurred = blur(image)
    assert blurred.dtype == np.float32
    np.testing.assert_allclose(blurred, blur(image.astype(np.float64)), atol=1e-6)
    for shape in [(40, 23, 3), (20, 20, 30), (11, 12, 1)]:
        image = np.random.default_rng(1).random(shape)
        expected = cv2.GaussianBlur(image, (11, 11), 1.5, borderType=cv2.BORDER_REFLECT).reshape(shape)
        np.testing.assert_allclose(blur(image), expected, atol=1e-12)
    refuses("upscales nothing, but scale 4", finished_lenses, low_eia(), np.ones(1, bool), "none",
            np.zeros((1, 2), int))
    low = low_eia(scale=1)
    np.testing.assert_array_equal(upscaled("none", low).reshape(low.color.shape), low.color)
    assert load_method("bicubic").upscaler(low_eia(), np.zeros((0, 2), int)).shape == (0, 20, 24, 3)
    for name in FLAGS:
        color = np.zeros((1, 1, 5, 5, 3))
        color[0, 0, :, 2:] = 3e38
        assert np.isfinite(upscaled(name, low_eia(color=color))).all()


def low_eia(sy=3, sx=4, h=5, w=6, scale=4, color=None):
    color = RANDOM.random((sy, sx, h, w, 3)).astype(np.float32) if color is None else color.astype(np.float32)
    return LowResEIA(color, np.ones((*color.shape[:-1], 1), np.float32), 16, scale)


def all_lenses(low):
    return np.argwhere(np.ones(low.color.shape[:2], bool))


def upscaled(name, low):
    return load_method(name).upscaler(low, all_lenses(low))


@pytest.mark.parametrize("scale", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("name", FLAGS)
def test_each_elemental_image_is_resized_alone_as_by_opencv_in_the_order_asked_for(name, scale):
    low = low_eia(scale=scale)
    wanted = RANDOM.permutation(all_lenses(low))[:9]
    high = load_method(name).upscaler(low, wanted)
    assert high.shape == (9, 5 * scale, 6 * scale, 3) and high.dtype == np.float32
    for (row, column), image in zip(wanted, high, strict=True):
        expected = cv2.resize(encode(low.color[row, column]), None, fx=scale, fy=scale, interpolation=FLAGS[name])
        np.testing.assert_allclose(image, decode(expected), atol=2e-5)


def test_highlight_leaves_no_dark_ring_in_its_neighbourhood():
    """Interpolated linearly, a lamp 1000 times as bright as its surroundings blackens them."""
    color = np.full((1, 1, 9, 9, 3), 0.2)
    color[0, 0, 4, 4] = 200.0
    linear = cv2.resize(color[0, 0].astype(np.float32), None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC)
    assert (linear < 0.01).mean() > 0.05
    assert (upscaled("bicubic", low_eia(color=color))[0] < 0.01).mean() < (linear < 0.01).mean() / 2
    values = np.concatenate([np.linspace(0, 1, 101), np.geomspace(1, 6e4, 100)]).astype(np.float32)
    np.testing.assert_allclose(decode(encode(values)), values, rtol=1e-5, atol=1e-7)
    assert (np.diff(encode(values)) >= 0).all() and (decode(np.float32([-0.3, 0])) == 0).all()
