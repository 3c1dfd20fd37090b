"""Classical upscalers: interpolation inside each elemental image, by one matrix per axis, of encoded light.

The kernels are those of OpenCV's ``resize``, with which the tests compare.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.upscaler import Upscaler

MAX_EXPONENT = 80  # keeps overshoot beside the brightest floats finite
EIS_IN_CACHE = 8  # per step


def encode(linear: Array) -> Array:
    """Encode scene-linear values >= 0: √x up to 1, 1 + ½·ln x above.

    Interpolation of encoded highlights does not ring over dark neighbours, and decoding is fast on an 8K image.
    """
    encoded, bright = np.asarray(np.sqrt(np.minimum(linear, 1))), np.greater(linear, 1)
    if bright.any():
        # Highlights are few, so the logarithm is taken of them alone.
        encoded[bright] += np.log(linear[bright]) * np.float32(0.5)
    return encoded


def decode(encoded: Array, out: Array | None = None) -> Array:
    """Decode encoded values, into ``out`` if given; negative overshoot becomes 0."""
    bright = encoded > 1 if encoded.size and encoded.max() > 1 else None
    highlights = np.exp(np.minimum(2 * (encoded[bright] - 1), MAX_EXPONENT)) if bright is not None else None
    linear = np.maximum(encoded, 0, out=out)
    np.multiply(linear, linear, out=linear)
    if bright is not None:
        linear[bright] = highlights
    return linear


def linear(distance: Array) -> Array:
    """Tent, two samples wide."""
    return np.asarray(np.maximum(1 - np.abs(distance), 0))


def cubic(distance: Array) -> Array:
    """Keys' cubic convolution, four samples wide."""
    a, x = -0.75, np.abs(distance)  # OpenCV's and Blender's choice of Keys' a (1981)
    inner = ((a + 2) * x - (a + 3)) * x * x + 1
    outer = ((a * x - 5 * a) * x + 8 * a) * x - 4 * a
    return np.where(x <= 1, inner, np.where(x < 2, outer, 0))


KERNELS: dict[str, tuple[int, Callable[[Array], Array]]] = {
    # A box, one sample wide; a tie goes to the sample on the right.
    "nearest": (1, lambda distance: ((distance > -0.5) & (distance <= 0.5)).astype(np.float64)),
    "linear": (1, linear), "cubic": (2, cubic),
    # sinc windowed by a sinc four times as wide.
    "lanczos": (4, lambda distance: np.where(np.abs(distance) < 4, np.sinc(distance) * np.sinc(distance / 4), 0)),
    # Sharper than the tent, less noisy than the cubic.
    "halfway": (2, lambda distance: (linear(distance) + cubic(distance)) / 2)}
"""By name: samples to either side, and the weight at a distance in samples."""


@functools.lru_cache(maxsize=64)
def kernel_matrix(kernel: str, size: int, scale: float, margin: int = 0) -> Array:
    """Weights (size·scale, size + 2·margin) float32 that upscale a row of samples at half-pixel centres.

    ``margin``: further samples at either end, which are only looked at; beyond them the last sample is repeated.
    """
    reach, weight = KERNELS[kernel]
    count = round(size * scale)
    places = (np.arange(count) + 0.5) / scale - 0.5 + margin
    taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
    weights = weight(places[:, None] - taps)
    weights /= weights.sum(1, keepdims=True)
    matrix = np.zeros((count, size + 2 * margin))
    np.add.at(matrix, (np.arange(count)[:, None], np.clip(taps, 0, size + 2 * margin - 1)), weights)
    return matrix.astype(np.float32)


@functools.lru_cache(maxsize=16)
def _column_matrix(kernel: str, columns: int, scale: int, margin: int, channels: int) -> Array:
    """``kernel_matrix`` as (w·C, W·C) for rows of interleaved channels."""
    return np.kron(kernel_matrix(kernel, columns, scale, margin).T, np.eye(channels, dtype=np.float32))


def interpolated(images: Array, kernel: str, factors: tuple[int, int], margin: int = 0,
                 out: Array | None = None) -> Array:
    """Upscale ``images`` (N, h + 2·margin, w + 2·margin, C) by ``factors`` (horizontal, vertical).

    ``margin``: pixels around each image that are only looked at. Returns (N, h·vertical, w·horizontal, C), in ``out``
    if given, which must be contiguous.
    """
    count, rows, columns, channels = images.shape
    down = kernel_matrix(kernel, rows - 2 * margin, factors[1], margin)
    across = _column_matrix(kernel, columns - 2 * margin, factors[0], margin, channels)
    tall = (down @ images.reshape(count, rows, columns * channels)).reshape(-1, columns * channels)
    wide = np.matmul(tall, across, out=None if out is None else out.reshape(len(tall), -1))
    return np.asarray(wide).reshape(count, len(down), across.shape[1] // channels, channels)


@dataclasses.dataclass(frozen=True)
class Interpolation(Upscaler):
    """One kernel in both directions of each EI; at scale 1 the EIs as they are."""

    kernel: str  # of KERNELS
    crosstalk: bool = False  # interpolate across the borders of EIs, as if the EIA were one photograph
    thread_safe: bool = True

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        lenses, margin = np.asarray(lenses), 4 if self.crosstalk else 0  # half the widest kernel
        if low.scale == 1:
            return np.asarray(low.color[lenses[:, 0], lenses[:, 1]])
        result = np.empty((len(lenses), *low.finished_views, low.color.shape[-1]), np.float32)
        for start in range(0, len(lenses), EIS_IN_CACHE):
            part = slice(start, start + EIS_IN_CACHE)
            seen = encode(_gather(low.color, lenses[part], margin))
            decode(interpolated(seen, self.kernel, low.factors, margin, result[part]), out=result[part])
        return result


def _gather(images: Array, lenses: Array, margin: int) -> Array:
    """EIs of ``lenses`` with ``margin`` pixels of their neighbours around, (N, h + 2·margin, w + 2·margin, C)."""
    if margin == 0:
        return np.asarray(images[lenses[:, 0], lenses[:, 1]])
    sy, sx, height, width, _ = images.shape
    rows = np.clip(lenses[:, :1] * height + np.arange(-margin, height + margin), 0, sy * height - 1)
    columns = np.clip(lenses[:, 1:] * width + np.arange(-margin, width + margin), 0, sx * width - 1)
    row, y, column, x = rows // height, rows % height, columns // width, columns % width
    return np.asarray(images[row[:, :, None], column[:, None, :], y[:, :, None], x[:, None, :]])
