"""Classical upscalers: interpolation inside each elemental image, as matrices that act on one axis.

The kernels are those of OpenCV's ``resize``, which the tests compare with.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.encoding import decode, encode

CUBIC_SHARPNESS = -0.75  # OpenCV's and Blender's choice of Keys' a (1981)


def nearest(distance: Array) -> Array:
    """1 for the sample in whose pixel the point lies; the tie goes to the right one, as ``floor`` says."""
    return ((distance > -0.5) & (distance <= 0.5)).astype(np.float64)


def linear(distance: Array) -> Array:
    """Tent, two samples wide."""
    return np.maximum(1 - np.abs(distance), 0)


def cubic(distance: Array) -> Array:
    """Keys' cubic convolution, four samples wide."""
    a, x = CUBIC_SHARPNESS, np.abs(distance)
    inner = ((a + 2) * x - (a + 3)) * x * x + 1
    outer = ((a * x - 5 * a) * x + 8 * a) * x - 4 * a
    return np.where(x <= 1, inner, np.where(x < 2, outer, 0))


def lanczos(distance: Array) -> Array:
    """sinc windowed by a sinc four times as wide: eight samples."""
    return np.where(np.abs(distance) < 4, np.sinc(distance) * np.sinc(distance / 4), 0)


KERNELS: dict[str, tuple[int, Callable[[Array], Array]]] = {
    "nearest": (1, nearest), "linear": (1, linear), "cubic": (2, cubic), "lanczos": (4, lanczos),
}
"""Reach in samples to either side, and the weight at a distance from a sample."""


@functools.lru_cache(maxsize=64)
def kernel_matrix(kernel: str, size: int, scale: int, margin: int = 0) -> Array:
    """Matrix that upscales a row of samples at half-pixel centres; beyond the last one it repeats.

    Parameters
    ----------
    kernel : of KERNELS
    size : samples to upscale
    scale : values per sample
    margin : more samples on either side

    Returns
    -------
    Weights (size·scale, size + 2·margin), float32
    """
    reach, weight = KERNELS[kernel]
    places = (np.arange(size * scale) + 0.5) / scale - 0.5 + margin
    taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
    weights = weight(places[:, None] - taps)
    weights /= weights.sum(1, keepdims=True)
    matrix = np.zeros((size * scale, size + 2 * margin))
    np.add.at(matrix, (np.arange(size * scale)[:, None], np.clip(taps, 0, size + 2 * margin - 1)), weights)
    return matrix.astype(np.float32)


EIS_IN_CACHE = 8  # per step of an interpolation: their result stays in a core's cache
CROSSTALK_REACH = 4  # half the widest kernel


@dataclasses.dataclass(frozen=True)
class Interpolation:
    """A classical upscaler: one kernel in both directions of each EI. The other fields are those of ``Upscaler``."""

    name: str
    kernel: str  # of KERNELS
    # samples beyond an EI are the CROSSTALK_REACH nearest pixels of its neighbours, as if the EIA were one photograph,
    # and do not repeat its border
    crosstalk: bool = False
    thread_safe: bool = True
    notes: tuple[str, ...] = ()

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        lenses, margin = np.asarray(lenses), CROSSTALK_REACH if self.crosstalk else 0
        result = np.empty((len(lenses), *low.finished_views, low.color.shape[-1]), np.float32)
        for start in range(0, len(lenses), EIS_IN_CACHE):
            part = slice(start, start + EIS_IN_CACHE)
            encoded = encode(_gather(low.color, lenses[part], margin))
            interpolate(encoded, self.kernel, low.factors, result[part], margin)
        return result

    def clean(self, low: LowResEIA, lenses: Array) -> Array:
        """What is interpolated: EIs of ``lenses``, (N, h, w, 3) in the domain of ``encode``."""
        return encode(low.color[lenses[:, 0], lenses[:, 1]])


def interpolate(encoded: Array, kernel: str, factors: tuple[int, int], out: Array, margin: int = 0) -> None:
    """Upscale elemental images.

    Parameters
    ----------
    encoded : (n, h + 2·margin, w + 2·margin, C)
    kernel : of KERNELS
    factors : values per sample, (horizontal, vertical)
    out : (n, h·vertical, w·horizontal, C), filled with scene-linear values
    margin : pixels around each that are only looked at
    """
    count, rows, columns, channels = encoded.shape
    down = kernel_matrix(kernel, rows - 2 * margin, factors[1], margin)
    across = interleaved(kernel, columns - 2 * margin, factors[0], margin, channels)
    tall = (down @ encoded.reshape(count, rows, columns * channels)).reshape(-1, columns * channels)
    finished = out.reshape(len(tall), -1)
    decode(np.matmul(tall, across, out=finished), out=finished)


@functools.lru_cache(maxsize=16)
def interleaved(kernel: str, columns: int, scale: int, margin: int, channels: int) -> Array:
    """Matrix (columns·channels + margins, columns·scale·channels) that upscales rows of interleaved channels.

    The same weights for each, zero between them. Other parameters as of ``kernel_matrix``.
    """
    return np.kron(kernel_matrix(kernel, columns, scale, margin).T, np.eye(channels, dtype=np.float32))


@dataclasses.dataclass(frozen=True)
class NoUpscaling:
    """Scale 1: the render is already at full resolution."""

    name: str = "none"
    kernel: str = "nearest"
    thread_safe: bool = True
    notes: tuple[str, ...] = ()

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        if low.scale != 1:
            raise LfsrError(f"method {self.name!r} does not upscale, but the frame was rendered at scale {low.scale}: "
                            "choose an upscaling method, or render at scale 1")
        return low.color[lenses[:, 0], lenses[:, 1]]

    def clean(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs of ``lenses``, (N, h, w, 3) in the domain of ``encode``."""
        return encode(self(low, lenses))


def _gather(images: Array, lenses: Array, margin: int) -> Array:
    """EIs of ``lenses`` with ``margin`` pixels of their neighbours around, (N, h + 2·margin, w + 2·margin, C)."""
    if margin == 0:
        return images[lenses[:, 0], lenses[:, 1]]
    sy, sx, height, width, _ = images.shape
    rows = np.clip(lenses[:, :1] * height + np.arange(-margin, height + margin), 0, sy * height - 1)
    columns = np.clip(lenses[:, 1:] * width + np.arange(-margin, width + margin), 0, sx * width - 1)
    row, y, column, x = rows // height, rows % height, columns // width, columns % width
    return images[row[:, :, None], column[:, None, :], y[:, :, None], x[:, None, :]]
