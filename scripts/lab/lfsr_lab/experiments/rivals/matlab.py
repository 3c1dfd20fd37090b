"""The image functions of MATLAB that the networks were trained and run with: resizing, median, colour, shifts."""

from __future__ import annotations

import functools

import numpy as np
from scipy.ndimage import median_filter

from lfsr_core.base.arrays import Array

KEYS = -0.5  # of MATLAB's cubic convolution
# rows: Y, Cb, Cr of red, green, blue in [0, 1], as in ITU-R BT.601 with head and foot room
YCBCR = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]) / 255
OFFSET = np.array([16.0, 128.0, 128.0]) / 255


def keys(distance: Array) -> Array:
    """Return the weight of cubic convolution at a distance in samples."""
    x = np.abs(distance)
    inner = ((KEYS + 2) * x - (KEYS + 3)) * x * x + 1
    outer = KEYS * (((x - 5) * x + 8) * x - 4)
    return np.where(x <= 1, inner, np.where(x < 2, outer, 0.0))


def linear(distance: Array) -> Array:
    """Return the weight of linear interpolation at a distance in samples."""
    return np.maximum(1 - np.abs(distance), 0.0)


@functools.lru_cache(maxsize=64)
def resize_matrix(size: int, wanted: int) -> Array:
    """Return the weights (wanted, size) of ``imresize``: cubic, at half-pixel centres, mirrored, wider to shrink."""
    scale = wanted / size
    wide = min(scale, 1.0)
    places = (np.arange(wanted) + 0.5) / scale - 0.5
    taps = np.floor(places)[:, None].astype(int) + np.arange(-int(np.ceil(2 / wide)), int(np.ceil(2 / wide)) + 2)
    weights = keys((places[:, None] - taps) * wide)
    matrix = np.zeros((wanted, size))
    mirrored = np.concatenate([np.arange(size), np.arange(size)[::-1]])[taps % (2 * size)]
    np.add.at(matrix, (np.arange(wanted)[:, None], mirrored), weights / weights.sum(1, keepdims=True))
    return matrix


def resized(values: Array, axis: int, wanted: int) -> Array:
    """Return ``values`` resized along one axis."""
    return np.moveaxis(np.tensordot(resize_matrix(values.shape[axis], wanted), values, (1, axis)), 0, axis)


def moved(values: Array, axis: int, by: float, cubic: bool) -> Array:
    """Return ``values`` at places that lie ``by`` samples further along an axis; NaN outside (``interp2``)."""
    values = np.moveaxis(values, axis, 0)
    places = np.arange(len(values)) + by
    first, reach, weight = np.floor(places).astype(int), (2 if cubic else 1), (keys if cubic else linear)
    found = np.zeros(values.shape)
    for tap in range(1 - reach, reach + 1):
        of_tap = weight(places - (first + tap))
        if of_tap.any():
            found += of_tap.reshape(-1, *[1] * (values.ndim - 1)) * values[np.clip(first + tap, 0, len(values) - 1)]
    found[(places < 0) | (places > len(values) - 1)] = np.nan
    return np.moveaxis(found, 0, axis)


def median3(values: Array) -> Array:
    """Return the 3×3 median of (H, W, …), zero outside (``medfilt2``)."""
    return np.asarray(median_filter(values, size=(3, 3, *[1] * (values.ndim - 2)), mode="constant"))


def to_ycbcr(rgb: Array) -> Array:
    """Return Y, Cb, Cr in [0, 1] of (…, 3) in [0, 1] (``rgb2ycbcr``)."""
    return np.asarray(rgb @ YCBCR.T + OFFSET)


def from_ycbcr(values: Array) -> Array:
    """Return red, green, blue in [0, 1] of (…, 3) (``ycbcr2rgb``)."""
    return np.clip((values - OFFSET) @ np.linalg.inv(YCBCR).T, 0, 1)
