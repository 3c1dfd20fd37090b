"""Weights of classical interpolation kernels, as matrices that act on one axis.

The kernels are those of OpenCV's ``resize``, which the tests compare with.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

CUBIC_SHARPNESS = -0.75  # OpenCV's and Blender's choice of Keys' a (1981)


def nearest(distance: np.ndarray) -> np.ndarray:
    """1 for the sample in whose pixel the point lies; the tie goes to the right one, as ``floor`` says."""
    return ((distance > -0.5) & (distance <= 0.5)).astype(np.float64)


def linear(distance: np.ndarray) -> np.ndarray:
    """Tent, two samples wide."""
    return np.maximum(1 - np.abs(distance), 0)


def cubic(distance: np.ndarray) -> np.ndarray:
    """Keys' cubic convolution, four samples wide."""
    a, x = CUBIC_SHARPNESS, np.abs(distance)
    inner = ((a + 2) * x - (a + 3)) * x * x + 1
    outer = ((a * x - 5 * a) * x + 8 * a) * x - 4 * a
    return np.where(x <= 1, inner, np.where(x < 2, outer, 0))


def lanczos(distance: np.ndarray) -> np.ndarray:
    """sinc windowed by a sinc four times as wide: eight samples."""
    return np.where(np.abs(distance) < 4, np.sinc(distance) * np.sinc(distance / 4), 0)


KERNELS: dict[str, tuple[int, Callable[[np.ndarray], np.ndarray]]] = {
    "nearest": (1, nearest), "linear": (1, linear), "cubic": (2, cubic), "lanczos": (4, lanczos),
}
"""Reach in samples to either side, and the weight at a distance from a sample."""


@functools.lru_cache(maxsize=64)
def kernel_matrix(kernel: str, size: int, scale: int, margin: int = 0) -> np.ndarray:
    """Weights (size·scale, size + 2·margin) float32 that upscale ``size`` samples with ``margin`` more on either side.

    Samples sit at half-pixel centres; beyond the last one it repeats.
    """
    reach, weight = KERNELS[kernel]
    places = (np.arange(size * scale) + 0.5) / scale - 0.5 + margin
    taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
    weights = weight(places[:, None] - taps)
    weights /= weights.sum(1, keepdims=True)
    matrix = np.zeros((size * scale, size + 2 * margin))
    np.add.at(matrix, (np.arange(size * scale)[:, None], np.clip(taps, 0, size + 2 * margin - 1)), weights)
    return matrix.astype(np.float32)
