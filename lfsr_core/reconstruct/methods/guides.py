"""What albedo and normal tell a denoiser: smoothed where they are grain, denoised where they may show detail.

A pixel of an EIA covers a whole lens, so they are as noisy as colour, and a denoiser takes their grain for edges. A
Gaussian inside each elemental image serves it better than guides that were denoised themselves, and costs nothing
(measured: docs/results/networks.md). Noise is white, so its finest band tells how much of it is in a coarser one: of
that band what exceeds noise stays (Wiener's weight). Where the Gaussian takes away more than noise usually is, it may
take fine detail: there the library says how much of it is, and that stays.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.reconstruct.methods.rectangles import Box, rectangles

GUIDES = ("albedo", "normal")
WIDTH, SAMPLES = 2.0, 16  # of the Gaussian: standard deviation, in pixels, at so many samples per pixel
NARROWEST, WIDEST = 1.0, 4.0  # at any number of samples
FINE = 0.7  # Gaussian, in pixels, that parts the finest band, taken for noise, from the coarser one
NOISIER = 1.5  # times the noise that the finest band tells of: the coarser one must exceed that
# From the first to the second a coarser band, in rms at SAMPLES samples, is too much to be lost at half the resolution.
STRUCTURE = (0.012, 0.024)
# Mean of what the Gaussian takes away, times √samples, of values in [0, 1]: up to the first it is noise, from the
# second on the library is asked.
NOISE, DOUBT = 0.24, 0.36
LEAST_DOUBT = 0.05  # below it an EI is not worth a rectangle
# Of what the library left: the Gaussian that takes its own mistakes away, in pixels, and how far from that it must be
# to be detail, in rms times √samples.
CLEANED_WIDTH = 1.5
DETAIL = (0.16, 0.3)


@dataclasses.dataclass(frozen=True)
class Cleaner:
    """The library, asked where there may be detail."""

    clean: Callable[[Array], Array]  # EIs (sy, sx, h, w, 3) in [0, 1], without their noise
    pixels: tuple[int, int]  # of the image that it denoises a lens takes so many, (h, w)


@dataclasses.dataclass(frozen=True)
class Guides:
    """Guides of a rectangle of lenses, ready for the denoiser."""

    images: dict[str, Array]  # those there are, (sy, sx, h, w, 3): albedo in [0, 1], normal in [-1, 1]
    detail: Array  # (sy, sx) in [0, 1]: how surely a lens shows detail, which was not smoothed

    def part(self, lenses: Box) -> dict[str, Array]:
        """The images of some ``lenses``, rows and columns."""
        return {name: images[lenses] for name, images in self.images.items()}


def guides_of(layers: Mapping[str, Array], samples: int, cleaner: Cleaner) -> Guides | None:
    """Guides from the rendered "albedo" and "normal" (sy, sx, h, w, 3); None where there is no albedo.

    ``samples`` per pixel: few are smoothed more, and less of what they show counts as detail.
    """
    if "albedo" not in layers:
        return None
    made = {name: _made(in_unit(name, layers[name]), samples, cleaner) for name in GUIDES if name in layers}
    images = {name: from_unit(name, image) for name, (image, _) in made.items()}
    return Guides(images, np.maximum.reduce([detail for _, detail in made.values()]))


def in_unit(name: str, images: Array) -> Array:
    """Values in [0, 1]; Cycles adds emission to albedo."""
    return np.clip(images, 0, 1) if name == "albedo" else np.clip(images, -1, 1) / 2 + np.float32(0.5)


def from_unit(name: str, images: Array) -> Array:
    """``in_unit`` undone."""
    return images if name == "albedo" else images * 2 - 1


def _made(images: Array, samples: int, cleaner: Cleaner) -> tuple[Array, Array]:
    """EIs (sy, sx, h, w, 3) without grain and, (sy, sx), how surely each shows detail."""
    result, doubt, detail = _smoothed(images, samples)
    detail *= 1 - doubt
    for found in rectangles(doubt > 0, cleaner.pixels):
        cleaned = cleaner.clean(images[found.outer])[found.crop]
        kept, sure = _kept(cleaned, samples)
        weight = doubt[found.inner]
        result[found.inner] += weight[:, :, None, None, None] * (kept - result[found.inner])
        detail[found.inner] = np.maximum(detail[found.inner], weight * sure)
    return result, detail


def _smoothed(images: Array, samples: int) -> tuple[Array, Array, Array]:
    """EIs without grain and, (sy, sx) in [0, 1], how surely that took more than noise, and of how much that stayed.

    The last: whether it is too much to be lost at half the resolution.
    """
    result = np.empty(images.shape, np.float32)
    doubt, structure = (np.empty(images.shape[:2], np.float32) for _ in range(2))
    for row, rendered in enumerate(images):  # of lenses: what stays in the cache
        fine, broad = (_blurred(rendered, width) for width in (FINE, _width(samples)))
        energy, noise = np.square(fine - broad).mean((1, 2, 3)), NOISIER * _noise_of(rendered, fine, _width(samples))
        weight = np.divide(energy - noise, energy, out=np.zeros_like(energy), where=energy > noise)
        result[row] = broad + weight[:, None, None, None] * (fine - broad)
        taken = np.abs(rendered - broad).max(-1).mean((1, 2))
        doubt[row] = smooth_step(taken * np.sqrt(samples), NOISE, DOUBT)
        structure[row] = smooth_step(np.sqrt(np.maximum(energy - noise, 0) * samples / SAMPLES), *STRUCTURE)
    return result, np.where(doubt > LEAST_DOUBT, doubt, 0), structure


def _noise_of(rendered: Array, fine: Array, width: float) -> Array:
    """(N,) variance of white noise in the coarser band of EIs (N, h, w, 3), by that in the finest."""
    size = rendered.shape[1:3]
    finest, coarser = _white(size, 0, FINE), _white(size, FINE, width)
    return np.square(rendered - fine).mean((1, 2, 3)) * (coarser / finest if finest else 0)


def _kept(cleaned: Array, samples: int) -> tuple[Array, Array]:
    """What stays of denoised EIs (sy, sx, h, w, 3), and (sy, sx) in [0, 1] how surely that holds detail."""
    smooth = _blurred(cleaned.reshape(-1, *cleaned.shape[2:]), CLEANED_WIDTH).reshape(cleaned.shape)
    sure = smooth_step(np.sqrt(np.square(cleaned - smooth).mean((2, 3, 4)) * samples), *DETAIL)
    return smooth + sure[:, :, None, None, None] * (cleaned - smooth), sure


def _width(samples: int) -> float:
    # Noise falls with the root of the samples; what is smoothed can be narrower by the root of that.
    return float(np.clip(WIDTH * (SAMPLES / samples) ** 0.25, NARROWEST, WIDEST))


def smooth_step(values: Array, low: float, high: float) -> Array:
    """0 up to ``low``, 1 from ``high`` on, smooth between."""
    values = np.clip((values - low) / (high - low), 0, 1).astype(np.float32)
    return values * values * (3 - 2 * values)


def _blurred(images: Array, width: float) -> Array:
    """EIs (N, h, w, 3) after a Gaussian inside each."""
    count, rows, columns, channels = images.shape
    down, across = (_gaussian(size, width) for size in (rows, columns))
    tall = (down @ images.reshape(count, rows, -1)).reshape(-1, columns * channels)
    return (tall @ np.kron(across.T, np.eye(channels, dtype=np.float32))).reshape(images.shape)


@functools.lru_cache(maxsize=16)
def _white(size: tuple[int, int], narrow: float, broad: float) -> float:
    """Mean square of what lies between two Gaussians, 0 for none, of white noise of variance 1 in EIs of ``size``."""
    first, second = ([_gaussian(side, width) if width else np.eye(side) for side in size] for width in (narrow, broad))
    return _overlap(first, first) - 2 * _overlap(first, second) + _overlap(second, second)


def _overlap(one: list[Array], other: list[Array]) -> float:
    """Mean product of what two filters, of rows and of columns, make of the same white noise."""
    return float(np.prod([np.sum(a * b, axis=1).mean() for a, b in zip(one, other, strict=True)]))


@functools.lru_cache(maxsize=16)
def _gaussian(size: int, width: float) -> Array:
    """Weights (size, size) that smooth a row of pixels, of which the outermost go on beyond its ends."""
    reach = int(np.ceil(4 * width))
    places = np.arange(-reach, size + reach)
    weights = np.exp(-0.5 * ((places[None] - np.arange(size)[:, None]) / width) ** 2)
    result = np.zeros((size, size))
    np.add.at(result.T, np.clip(places, 0, size - 1), weights.T)
    return (result / result.sum(1, keepdims=True)).astype(np.float32)
