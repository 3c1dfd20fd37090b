"""Interpolation matrices and the Gaussian blur against OpenCV's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from lfsr_core.metrics.split_ssim import blur
from lfsr_core.reconstruct.methods.interpolation import kernel_matrix

FLAGS = {"nearest": cv2.INTER_NEAREST, "linear": cv2.INTER_LINEAR, "cubic": cv2.INTER_CUBIC,
         "lanczos": cv2.INTER_LANCZOS4}


@pytest.mark.parametrize("kernel", FLAGS)
@pytest.mark.parametrize("scale", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("margin", [0, 4])
def test_weights_are_those_of_opencv(kernel: str, scale: int, margin: int) -> None:
    size = 10
    padded = size + 2 * margin
    # Resizing the identity in one direction shows the weight of every sample.
    weights = cv2.resize(np.eye(padded, dtype=np.float32), (padded, padded * scale), interpolation=FLAGS[kernel])
    expected = weights[margin * scale:(margin + size) * scale]
    np.testing.assert_allclose(kernel_matrix(kernel, size, scale, margin), expected, atol=1e-5)


@pytest.mark.parametrize("shape", [(40, 23, 3), (20, 20, 30), (11, 12, 1)])
def test_blur_is_that_of_opencv(shape: tuple[int, int, int]) -> None:
    image = np.random.default_rng(1).random(shape)
    expected = cv2.GaussianBlur(image, (11, 11), 1.5, borderType=cv2.BORDER_REFLECT).reshape(shape)
    np.testing.assert_allclose(blur(image, 1.5, 11), expected, atol=1e-12)


def test_blur_keeps_single_precision() -> None:
    image = np.random.default_rng(1).random((30, 30, 3), dtype=np.float32)
    blurred = blur(image, 1.5, 11)
    assert blurred.dtype == np.float32
    np.testing.assert_allclose(blurred, blur(image.astype(np.float64), 1.5, 11), atol=1e-6)
