"""Denoiser guides from the rendered albedo and normal: smoothed, except where they show detail.

A pixel of an EIA covers a whole lens, so albedo and normal are as noisy as colour, and a denoiser takes their noise
for edges. A Gaussian inside each elemental image makes better guides than the denoiser itself does, at no cost
(docs/notebook/networks.md). White noise has the same strength in every band, so the finest band tells how much noise a
coarser one holds; the rest of that band is kept (Wiener's weight). Where the Gaussian removes more than noise, it may
remove fine detail: the denoiser is then asked how much of it is detail, and that is kept.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.reconstruct.methods.interpolation import apply_matrices, per_channel
from lfsr_core.reconstruct.methods.rectangles import rectangles

GUIDES = ("albedo", "normal")
WIDTH, SAMPLES = 2.0, 16  # of the Gaussian: standard deviation in pixels, at this number of samples per pixel
NARROWEST, WIDEST = 1.0, 4.0  # at any number of samples
FINE = 0.7  # Gaussian in pixels between the finest band, taken for noise, and the coarser one
NOISIER = 1.5  # times the noise estimated from the finest band that the coarser one must exceed
# Strength of the coarser band, rms at SAMPLES samples, from which half resolution starts to lose it, and loses it all.
STRUCTURE = (0.012, 0.024)
# Mean that the Gaussian removes, times √samples, of values in [0, 1]: all noise up to NOISE, in doubt from DOUBT on.
NOISE, DOUBT = 0.24, 0.36
LEAST_DOUBT = 0.05  # below it an EI is not worth a rectangle
CLEANED_WIDTH = 1.5  # Gaussian in pixels that smooths the denoiser's result where it shows no detail
DETAIL = (0.16, 0.3)  # rms that it removes, times √samples: detail is possible from the first, certain from the second


Denoise = Callable[[Array], Array]  # takes and returns EIs (sy, sx, h, w, 3) in [0, 1]


@dataclasses.dataclass(frozen=True)
class Guides:
    """Guides of a rectangle of lenses, ready for the denoiser."""

    images: dict[str, Array]  # by layer, (sy, sx, h, w, 3): albedo in [0, 1], normal in [-1, 1]
    detail: Array  # (sy, sx) in [0, 1]: certainty that a lens shows detail, which was not smoothed


def guides_of(layers: Mapping[str, Array], samples: int, denoise: Denoise,
              pixels: tuple[int, int]) -> Guides | None:
    """Guides from the rendered layers "albedo" and "normal" (sy, sx, h, w, 3); None without albedo.

    ``samples`` per pixel: the fewer, the more is smoothed and the less counts as detail. ``pixels``: (h, w) of a lens
    in the image that ``denoise`` makes of EIs.
    """
    if "albedo" not in layers:
        return None
    made = {name: _made(in_unit(name, layers[name]), samples, denoise, pixels) for name in GUIDES if name in layers}
    images = {name: from_unit(name, image) for name, (image, _) in made.items()}
    return Guides(images, np.maximum.reduce([detail for _, detail in made.values()]))


def in_unit(name: str, images: Array) -> Array:
    """Values in [0, 1]; Cycles adds emission to albedo."""
    return np.asarray(np.clip(images, 0, 1) if name == "albedo" else np.clip(images, -1, 1) / 2 + np.float32(0.5))


def from_unit(name: str, images: Array) -> Array:
    """Inverse of ``in_unit``."""
    return images if name == "albedo" else images * 2 - 1


def _made(images: Array, samples: int, denoise: Denoise, pixels: tuple[int, int]) -> tuple[Array, Array]:
    """Smoothed EIs (sy, sx, h, w, 3), and the certainty (sy, sx) that each shows detail."""
    result, doubt, detail = _smoothed(images, samples)
    detail *= 1 - doubt
    for found in rectangles(doubt > 0, pixels):
        kept, sure = _kept(denoise(images[found.outer])[found.crop], samples)
        weight = doubt[found.inner]
        result[found.inner] = blend(result[found.inner], kept, weight)
        detail[found.inner] = np.maximum(detail[found.inner], weight * sure)
    return result, detail


def _smoothed(images: Array, samples: int) -> tuple[Array, Array, Array]:
    """Smoothed EIs, doubt (sy, sx) that only noise was removed, and structure (sy, sx) that half resolution would lose.

    Doubt and structure are in [0, 1].
    """
    result = np.empty(images.shape, np.float32)
    doubt, structure = (np.empty(images.shape[:2], np.float32) for _ in range(2))
    for row, rendered in enumerate(images):  # one row of lenses stays in the cache
        fine, broad = (_blurred(rendered, width) for width in (FINE, _width(samples)))
        energy, noise = np.square(fine - broad).mean((1, 2, 3)), NOISIER * _noise_of(rendered, fine, _width(samples))
        weight = np.divide(energy - noise, energy, out=np.zeros_like(energy), where=energy > noise)
        result[row] = blend(broad, fine, weight)
        taken = np.abs(rendered - broad).max(-1).mean((1, 2))
        doubt[row] = smooth_step(taken * np.sqrt(samples), NOISE, DOUBT)
        structure[row] = smooth_step(np.sqrt(np.maximum(energy - noise, 0) * samples / SAMPLES), *STRUCTURE)
    return result, np.where(doubt > LEAST_DOUBT, doubt, 0), structure


def _noise_of(rendered: Array, fine: Array, width: float) -> Array:
    """Variance (N,) of white noise in the coarser band of EIs (N, h, w, 3), estimated from the finest band."""
    size = rendered.shape[1:3]
    finest, coarser = _white(size, 0, FINE), _white(size, FINE, width)
    return np.asarray(np.square(rendered - fine).mean((1, 2, 3)) * (coarser / finest if finest else 0))


def _kept(cleaned: Array, samples: int) -> tuple[Array, Array]:
    """Denoised EIs (sy, sx, h, w, 3), smoothed but for detail, and the certainty (sy, sx) of detail in [0, 1]."""
    smooth = _blurred(cleaned.reshape(-1, *cleaned.shape[2:]), CLEANED_WIDTH).reshape(cleaned.shape)
    sure = smooth_step(np.sqrt(np.square(cleaned - smooth).mean((2, 3, 4)) * samples), *DETAIL)
    return blend(smooth, cleaned, sure), sure


def _width(samples: int) -> float:
    # Noise falls with the root of the samples, so the Gaussian can narrow with the root of that.
    return float(np.clip(WIDTH * (SAMPLES / samples) ** 0.25, NARROWEST, WIDEST))


def blend(first: Array, second: Array, weight: Array) -> Array:
    """Mix EIs (…, h, w, C): the first where ``weight`` (…) is 0, the second where it is 1."""
    return np.asarray(first + weight[..., None, None, None] * (second - first))


def smooth_step(values: Array, low: float, high: float) -> Array:
    """0 up to ``low``, 1 from ``high`` on, smooth between."""
    values = np.clip((values - low) / (high - low), 0, 1).astype(np.float32)
    return np.asarray(values * values * (3 - 2 * values))


def _blurred(images: Array, width: float) -> Array:
    """EIs (N, h, w, 3) after a Gaussian inside each."""
    down, across = (_gaussian(size, width) for size in images.shape[1:3])
    return apply_matrices(images, down, per_channel(across, images.shape[3]))


@functools.lru_cache(maxsize=16)
def _white(size: tuple[int, int], narrow: float, broad: float) -> float:
    """Variance that white noise of variance 1 has between two Gaussians (0: none), in EIs of ``size``."""
    first, second = ([_gaussian(side, width) if width else np.eye(side) for side in size] for width in (narrow, broad))
    return _overlap(first, first) - 2 * _overlap(first, second) + _overlap(second, second)


def _overlap(one: list[Array], other: list[Array]) -> float:
    """Mean product of the same white noise after two filters, each given for rows and for columns."""
    return float(np.prod([np.sum(a * b, axis=1).mean() for a, b in zip(one, other, strict=True)]))


@functools.lru_cache(maxsize=16)
def _gaussian(size: int, width: float) -> Array:
    """Weights (size, size) that smooth a row of pixels whose ends are repeated."""
    reach = int(np.ceil(4 * width))
    places = np.arange(-reach, size + reach)
    weights = np.exp(-0.5 * ((places[None] - np.arange(size)[:, None]) / width) ** 2)
    result = np.zeros((size, size))
    np.add.at(result.T, np.clip(places, 0, size - 1), weights.T)
    return np.asarray(result / result.sum(1, keepdims=True), np.float32)
