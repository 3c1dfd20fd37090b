"""Interpolation along epipolar lines: a point stands in other lenses between two rendered views."""

from __future__ import annotations

import functools
import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.reconstruct.methods.interpolation import KERNELS, kernel_matrix

LENS_KERNEL = "cubic"  # across lenses, along a line


def sheared(images: Array, covered: Array, lenses: Array, factors: tuple[int, int], steep: float) -> Array:
    """EIs (N, h·vertical, w·horizontal, 3) of ``lenses`` (N, 2), interpolated along lines of ``steep`` lenses per view.

    ``images`` (sy, sx, h, w, 3): rendered EIs. ``covered`` (sy, sx) bool: lenses to interpolate from. ``factors``:
    views per rendered view, (horizontal, vertical).
    """
    (sy, sx, h, w, _), reach, covered = images.shape, _lens_reach(steep), covered.astype(np.float32)
    around = np.arange(-reach, reach + 1)
    rows = np.clip(lenses[:, :1] + around, 0, sy - 1)[:, :, None]
    columns = np.clip(lenses[:, 1:] + around, 0, sx - 1)[:, None, :]
    down, across = (_shear(*axis, steep) for axis in zip((h, w), factors[::-1], strict=True))
    weight = down.sum(2) @ covered[rows, columns] @ across.sum(2).T
    # (N, lens row, lens column, view row, view column, C): rows of lenses and views first, then columns.
    tall = np.einsum("aov,noqvuc->nqauc", down, images[rows, columns], optimize=True)
    detail = np.einsum("bqu,nqauc->nabc", across, tall, optimize=True)
    return np.asarray(detail / np.maximum(weight, 0.5)[..., None])


def _lens_reach(steep: float) -> int:
    return math.ceil(abs(steep)) + KERNELS[LENS_KERNEL][0]


@functools.lru_cache(maxsize=64)
def _shear(size: int, scale: int, steep: float) -> Array:
    """Weights (size·scale, lenses around, size) of the two nearest rendered views, in the lenses on the line."""
    reach, weight = _lens_reach(steep), KERNELS[LENS_KERNEL][1]
    places = (np.arange(size * scale) + 0.5) / scale - 0.5
    matrix = np.zeros((size * scale, 2 * reach + 1, size))
    for index, place in enumerate(places):
        near = kernel_matrix("linear", size, scale)[index]
        for view in np.flatnonzero(near):
            of_lenses = weight(steep * (view - place) - np.arange(-reach, reach + 1))
            matrix[index, :, view] = near[view] * of_lenses / of_lenses.sum()
    return matrix.astype(np.float32)
