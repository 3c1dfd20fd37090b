"""What networks of others need: stored weights, MatConvNet's layers, MATLAB's functions. No code of theirs is run."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import torch
import torch.nn.functional as nn
from scipy.ndimage import median_filter
from torch import Tensor

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError

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
    shifted = np.zeros(values.shape)
    for tap in range(1 - reach, reach + 1):
        of_tap = weight(places - (first + tap))
        if of_tap.any():
            shifted += of_tap.reshape(-1, *[1] * (values.ndim - 1)) * values[np.clip(first + tap, 0, len(values) - 1)]
    shifted[(places < 0) | (places > len(values) - 1)] = np.nan
    return np.moveaxis(shifted, 0, axis)


def median3(values: Array) -> Array:
    """Return the 3×3 median of (H, W, …), zero outside (``medfilt2``)."""
    return np.asarray(median_filter(values, size=(3, 3, *[1] * (values.ndim - 2)), mode="constant"))


def to_ycbcr(rgb: Array) -> Array:
    """Return Y, Cb, Cr in [0, 1] of (…, 3) in [0, 1] (``rgb2ycbcr``)."""
    return np.asarray(rgb @ YCBCR.T + OFFSET)


def from_ycbcr(values: Array) -> Array:
    """Return red, green, blue in [0, 1] of (…, 3) (``ycbcr2rgb``)."""
    return np.clip((values - OFFSET) @ np.linalg.inv(YCBCR).T, 0, 1)


def tensor(values: Array) -> Tensor:
    return torch.tensor(values, dtype=torch.float32)


def convolution(x: Tensor, weight: Array, bias: Array, pad: int) -> Tensor:
    """Convolve (N, in, H, W) with filters (h, w, in, out)."""
    return nn.conv2d(x, tensor(weight).permute(3, 2, 0, 1), tensor(bias), padding=pad)


def transposed(x: Tensor, weight: Array, bias: Array, step: tuple[int, int]) -> Tensor:
    """Return the transposed convolution of (N, in, H, W), uncropped, with filters (h, w, out, in)."""
    return nn.conv_transpose2d(x, tensor(weight).permute(3, 2, 0, 1), tensor(bias), stride=step)


def convolution_4d(x: Tensor, weight: Array, bias: Array, pad: tuple[int, int], step: int = 1) -> Tensor:
    """Convolve a light field over pixels and views.

    Parameters
    ----------
    x : (rows of views, columns of views, in, H, W)
    weight : (h, w, rows, columns, in, out)
    pad : of pixels and of views, with zeros on every side
    step : of views
    """
    filters = tensor(weight).permute(5, 2, 3, 4, 0, 1)
    rows, columns = filters.shape[1:3]
    x = nn.pad(x, (0, 0, 0, 0, 0, 0, pad[1], pad[1], pad[1], pad[1]))
    flat = filters.flatten(1, 3)
    made = [[nn.conv2d(x[v:v + rows, u:u + columns].flatten(0, 2)[None], flat, tensor(bias).ravel(), padding=pad[0])[0]
             for u in range(0, x.shape[1] - columns + 1, step)] for v in range(0, x.shape[0] - rows + 1, step)]
    return torch.stack([torch.stack(row) for row in made])


def stored(clones: Path, path: str) -> Path:
    """Return a file of a clone; LfsrError where it is missing."""
    file = clones / path
    if not file.is_file():
        raise LfsrError(f"{file} does not exist, expected stored weights: clone the repository {Path(path).parts[0]!r} "
                        f"into {clones}")
    return file


def cells(clones: Path, path: str) -> list[tuple[Array, Array]]:
    """Return (weights, biases) of every layer in a MATLAB file with the cell arrays ``weight`` and ``bias``."""
    cells = scipy.io.loadmat(stored(clones, path))
    return [(weight, bias.ravel()) for weight, bias in zip(cells["weight"].ravel(), cells["bias"].ravel(), strict=True)]


def parameters(clones: Path, path: str) -> dict[str, Array]:
    """Return the parameters of a MatConvNet DAG in a MATLAB file, by name."""
    params = scipy.io.loadmat(stored(clones, path))["net"]["params"][0, 0]
    return {str(name.item()): np.asarray(value) for name, value in
            zip(params["name"].ravel(), params["value"].ravel(), strict=True)}


def state(clones: Path, path: str) -> dict[str, Any]:
    return dict(torch.load(stored(clones, path), map_location="cpu", weights_only=True))
