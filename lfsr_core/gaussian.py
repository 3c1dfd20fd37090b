"""Gaussian blur of images, in NumPy: the Python that comes with Blender has no OpenCV."""

from __future__ import annotations

import numpy as np

STRIP_ROWS = 16  # what is being added up stays in a core's cache


def weights(sigma: float, window: int) -> np.ndarray:
    """Weights (window // 2 + 1,) of a Gaussian from its centre outwards; the whole odd window sums to 1."""
    half = np.exp(-np.arange(window // 2 + 1) ** 2 / (2 * sigma**2))
    return half / (2 * half.sum() - half[0])


def blur(values: np.ndarray, sigma: float, window: int) -> np.ndarray:
    """Blurred float (H, W, C) of the same type; beyond the border lies the mirror image, border pixel included.

    ``window``: odd width in pixels, at most twice the image's.
    """
    half, reach = weights(sigma, window).astype(values.dtype), window // 2
    padded = np.pad(values, ((reach, reach), (0, 0), (0, 0)), mode="symmetric")
    result = np.empty_like(values)
    for start in range(0, len(values), STRIP_ROWS):
        strip = padded[start:start + STRIP_ROWS + 2 * reach]
        across = np.pad(_along(strip, half), ((0, 0), (reach, reach), (0, 0)), mode="symmetric")
        result[start:start + STRIP_ROWS] = _along(across.swapaxes(0, 1), half).swapaxes(0, 1)
    return result


def _along(padded: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Weighted sum along the first axis, shorter by the window less one."""
    reach = len(half) - 1
    count = len(padded) - 2 * reach
    total = half[0] * padded[reach:reach + count]
    for offset in range(1, reach + 1):
        pair = padded[reach - offset:reach - offset + count] + padded[reach + offset:reach + offset + count]
        pair *= half[offset]
        total += pair
    return total
