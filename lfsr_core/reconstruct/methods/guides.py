"""What albedo and normal tell a denoiser: smoothed where they are grain, denoised where they may show detail.

A pixel of an EIA covers a whole lens, so they are as noisy as colour, and a denoiser takes their grain for edges. A
Gaussian inside each elemental image serves it better than guides that were denoised themselves, and costs nothing
(measured: docs/results/networks.md). Where that takes away more than noise usually is, it may take detail: there the
library says how much of it is, and that stays.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping

import numpy as np

from lfsr_core.reconstruct.methods.rectangles import Box, rectangles

GUIDES = ("albedo", "normal")
WIDTH, SAMPLES = 2.0, 16  # of the Gaussian: standard deviation, in pixels, at so many samples per pixel
NARROWEST, WIDEST = 1.0, 4.0  # at any number of samples
# Mean of what the Gaussian takes away, times √samples, of values in [0, 1]: up to the first it is noise, from the
# second on the library is asked.
NOISE, DOUBT = 0.24, 0.36
LEAST_DOUBT = 0.05  # below it an EI is not worth a rectangle
# Of what the library left: the Gaussian that takes its own mistakes away, in pixels, and how far from that it must be
# to be detail, in rms times √samples; less is enough where it is nearly all that was rendered (share of its variance).
CLEANED_WIDTH = 1.5
DETAIL, SLIGHT_DETAIL, SHARE = (0.2, 0.35), (0.05, 0.1), (0.85, 0.95)


@dataclasses.dataclass(frozen=True)
class Cleaner:
    """The library, asked where there may be detail."""

    clean: Callable[[np.ndarray], np.ndarray]  # EIs (sy, sx, h, w, 3) in [0, 1], without their noise
    pixels: tuple[int, int]  # of the image that it denoises a lens takes so many, (h, w)


@dataclasses.dataclass(frozen=True)
class Guides:
    """Guides of a rectangle of lenses, ready for the denoiser."""

    images: dict[str, np.ndarray]  # those there are, (sy, sx, h, w, 3): albedo in [0, 1], normal in [-1, 1]
    detail: np.ndarray  # (sy, sx) in [0, 1]: how surely a lens shows detail, which was not smoothed

    def part(self, lenses: Box) -> dict[str, np.ndarray]:
        """The images of some ``lenses``, rows and columns."""
        return {name: images[lenses] for name, images in self.images.items()}


def guides_of(layers: Mapping[str, np.ndarray], samples: int, cleaner: Cleaner) -> Guides | None:
    """Guides from the rendered "albedo" and "normal" (sy, sx, h, w, 3); None where there is no albedo.

    ``samples`` per pixel: few are smoothed more, and less of what they show counts as detail.
    """
    if "albedo" not in layers:
        return None
    made = {name: _made(_in_unit(name, layers[name]), samples, cleaner) for name in GUIDES if name in layers}
    images = {name: image if name == "albedo" else image * 2 - 1 for name, (image, _) in made.items()}
    return Guides(images, np.maximum.reduce([detail for _, detail in made.values()]))


def _in_unit(name: str, images: np.ndarray) -> np.ndarray:
    """Values in [0, 1]; Cycles adds emission to albedo."""
    return np.clip(images, 0, 1) if name == "albedo" else np.clip(images, -1, 1) / 2 + np.float32(0.5)


def _made(images: np.ndarray, samples: int, cleaner: Cleaner) -> tuple[np.ndarray, np.ndarray]:
    """EIs (sy, sx, h, w, 3) without grain and, (sy, sx), how surely each shows detail."""
    result, doubt = _smoothed(images, samples)
    detail = np.zeros_like(doubt)
    for found in rectangles(doubt > 0, cleaner.pixels):
        cleaned = cleaner.clean(images[found.outer])[found.crop]
        kept, sure = _kept(images[found.inner], cleaned, samples)
        weight = doubt[found.inner]
        result[found.inner] += weight[:, :, None, None, None] * (kept - result[found.inner])
        detail[found.inner] = weight * sure
    return result, detail


def _smoothed(images: np.ndarray, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """EIs after the Gaussian and, (sy, sx) in [0, 1], how surely it took more than noise."""
    result, doubt = np.empty(images.shape, np.float32), np.empty(images.shape[:2], np.float32)
    for row, rendered in enumerate(images):  # of lenses: what stays in the cache
        result[row] = _blurred(rendered, _width(samples))
        taken = np.abs(rendered - result[row]).max(-1).mean((1, 2))
        doubt[row] = _step(taken * np.sqrt(samples), NOISE, DOUBT)
    return result, np.where(doubt > LEAST_DOUBT, doubt, 0)


def _kept(rendered: np.ndarray, cleaned: np.ndarray, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """What stays of denoised EIs (sy, sx, h, w, 3), and (sy, sx) in [0, 1] how surely that holds detail."""
    smooth = _blurred(cleaned.reshape(-1, *cleaned.shape[2:]), CLEANED_WIDTH).reshape(cleaned.shape)
    variance, whole = (np.square(images - smooth).mean((2, 3, 4)) for images in (cleaned, rendered))
    share = np.divide(variance, whole, out=np.zeros_like(variance), where=whole > 0)
    strength = np.sqrt(variance * samples)
    sure = np.maximum(_step(share, *SHARE) * _step(strength, *SLIGHT_DETAIL), _step(strength, *DETAIL))
    return smooth + sure[:, :, None, None, None] * (cleaned - smooth), sure


def _width(samples: int) -> float:
    # Noise falls with the root of the samples; what is smoothed can be narrower by the root of that.
    return float(np.clip(WIDTH * (SAMPLES / samples) ** 0.25, NARROWEST, WIDEST))


def _step(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """0 up to ``low``, 1 from ``high`` on, smooth between."""
    values = np.clip((values - low) / (high - low), 0, 1).astype(np.float32)
    return values * values * (3 - 2 * values)


def _blurred(images: np.ndarray, width: float) -> np.ndarray:
    """EIs (N, h, w, 3) after a Gaussian inside each."""
    count, rows, columns, channels = images.shape
    down, across = (_gaussian(size, width) for size in (rows, columns))
    tall = (down @ images.reshape(count, rows, -1)).reshape(-1, columns * channels)
    return (tall @ np.kron(across.T, np.eye(channels, dtype=np.float32))).reshape(images.shape)


@functools.lru_cache(maxsize=16)
def _gaussian(size: int, width: float) -> np.ndarray:
    """Weights (size, size) that smooth a row of pixels, of which the outermost go on beyond its ends."""
    reach = int(np.ceil(4 * width))
    places = np.arange(-reach, size + reach)
    weights = np.exp(-0.5 * ((places[None] - np.arange(size)[:, None]) / width) ** 2)
    result = np.zeros((size, size))
    np.add.at(result.T, np.clip(places, 0, size - 1), weights.T)
    return (result / result.sum(1, keepdims=True)).astype(np.float32)
