"""Elemental images between the rendered views: inside each of them, or along epipolar lines through its neighbours."""

from __future__ import annotations

import functools
import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.reconstruct.methods.interpolation import KERNELS, interleaved, kernel_matrix

LENS_KERNEL = "cubic"  # across lenses, along a line


def interpolated(images: Array, kernel: str, factors: tuple[int, int]) -> Array:
    """EIs (N, h, w, 3) -> (N, h·vertical, w·horizontal, 3), in whatever domain; ``factors``: (horizontal, vertical)."""
    count, rows, columns, channels = images.shape
    down, across = kernel_matrix(kernel, rows, factors[1]), interleaved(kernel, columns, factors[0], 0, channels)
    tall = (down @ images.reshape(count, rows, -1)).reshape(-1, columns * channels)
    return (tall @ across).reshape(count, rows * factors[1], columns * factors[0], channels)


def averaged(images: Array, kernel: str, factors: tuple[int, int]) -> Array:
    """What low-resolution pixels of (sy, sx, h, w, 3) become when they are interpolated and averaged again."""
    down, across = (_blur(kernel, *axis) for axis in zip(images.shape[2:4], factors[::-1], strict=True))
    rows, columns, channels = images.shape[2:]
    tall = (down @ images.reshape(-1, rows, columns * channels)).reshape(-1, columns * channels)
    return (tall @ np.kron(across.T, np.eye(channels, dtype=np.float32))).reshape(images.shape)


def _blur(kernel: str, size: int, scale: int) -> Array:
    return kernel_matrix(kernel, size, scale).reshape(size, scale, size).mean(1)


def sheared(images: Array, covered: Array, lenses: Array, factors: tuple[int, int],
            steep: float) -> Array:
    """Elemental images at every view, along epipolar lines: between two rendered views a point stands in other lenses.

    Parameters
    ----------
    images : (sy, sx, h, w, 3), in whatever domain they are
    covered : (sy, sx) bool, lenses that may be asked
    lenses : (N, 2), those that are wanted
    factors : views per rendered view, (horizontal, vertical)
    steep : lenses per view of the line

    Returns
    -------
    (N, h·vertical, w·horizontal, 3)
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
    return detail / np.maximum(weight, 0.5)[..., None]


def _lens_reach(steep: float) -> int:
    return math.ceil(abs(steep)) + KERNELS[LENS_KERNEL][0]


@functools.lru_cache(maxsize=64)
def _shear(size: int, scale: int, steep: float) -> Array:
    """Weights (size·scale, lenses around, size) of both nearest rendered views, where these show the same point."""
    reach, weight = _lens_reach(steep), KERNELS[LENS_KERNEL][1]
    places = (np.arange(size * scale) + 0.5) / scale - 0.5
    matrix = np.zeros((size * scale, 2 * reach + 1, size))
    for index, place in enumerate(places):
        near = kernel_matrix("linear", size, scale)[index]
        for view in np.flatnonzero(near):
            of_lenses = weight(steep * (view - place) - np.arange(-reach, reach + 1))
            matrix[index, :, view] = near[view] * of_lenses / of_lenses.sum()
    return matrix.astype(np.float32)
