"""The sRGB curve at known points."""

import numpy as np

from lfsr_core.images.srgb import srgb_decode, srgb_encode


def test_srgb_curve_at_known_points():
    np.testing.assert_allclose(srgb_encode(np.array([-1, 0, 0.0031308, 0.18, 0.5, 1, 7])),
                               [0, 0, 0.04045, 0.46135613, 0.73535698, 1, 1], atol=1e-5)
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(srgb_decode(srgb_encode(values)), values, atol=1e-6)
    assert srgb_encode(np.float32([0.5])).dtype == np.float32
