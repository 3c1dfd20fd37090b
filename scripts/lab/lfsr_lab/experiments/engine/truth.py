"""How near images come to a reference, of all lenses or of some: the one truth of all studies.

The two halves of a reference have independent noise, so that products of errors against one and the other have none.
An error is 0 for a perfect image and less is better. ``errors`` takes the images of several seeds at once and returns
a value for each seed and lens:

- ``1-ssim``: 1 − split SSIM of display values; the reference's noise cancels.
- ``relmse``: mean of (x − a)(x − b) / (m² + RELATIVE), scene-linear, with the halves a and b, whose noise cancels, and
  m, the mean of both halves and of a pixel's channels. Of all pixels, the share TRIMMED whose squared error against
  the mean of the halves, averaged over seeds and channels, is largest is left out, the same for every seed.
- ``smape``: mean of 2 |x − m| / (|x| + |m| + SMALL), scene-linear, m the mean of the halves of each channel.
- ``flip``: HDR-FLIP against the mean of the halves, scene-linear, at EXPOSURES.

``bias2`` and ``variance`` of ``errors`` divide ``relmse``: the squared error of the mean over seeds, without the noise
of the reference and without the part of the variance that so few seeds leave in it; and the variance over seeds. Both
have one value per lens, and their sum is the mean of ``relmse`` over seeds.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property
from pathlib import Path
from typing import Any

import flip_evaluator
import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.frames.frame import LOW_RES_FILE, Finish, Frame, read_frame
from lfsr_core.images.color import srgb_encode
from lfsr_core.images.image_files import clean, read_layers
from lfsr_core.metrics.eia_metrics import METRIC_NAMES, Reference, check_reference, compare, listed_images, stacked_ssim
from lfsr_core.optics.rays import to_elemental_images
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_core.reconstruct.upscaler import foreground_mask, low_resolution, read_world, recall
from lfsr_lab.networks.methods import ready

SSIM, RELMSE, SMAPE, FLIP = MEASURES = ("1-ssim", "relmse", "smape", "flip")
BIAS, VARIANCE = PARTS = ("bias2", "variance")
LABELS = {SSIM: "1 − SSIM", RELMSE: "relMSE, trimmed of the top .1 %", SMAPE: "SMAPE", FLIP: "HDR-FLIP",
          BIAS: "bias², part of relMSE", VARIANCE: "variance, part of relMSE"}
RELATIVE, TRIMMED, SMALL = 0.01, 0.001, 0.01
# In stops. HDR-FLIP's own choice depends on the median, which is black where much of the background is seen.
EXPOSURES = {"startExposure": -2.0, "stopExposure": 2.0, "numExposures": 5}
VERSION = 3  # of how errors are measured


def errors(images: Array, half_a: Array, half_b: Array) -> dict[str, Array]:
    """Return every error of MEASURES (seeds, n), and PARTS (n,) where there are two or more seeds.

    Parameters
    ----------
    images : (seeds, n, py, px, 3), scene-linear elemental images of the same lenses, one render per seed
    half_a, half_b : (n, py, px, 3), the halves of the reference, scene-linear
    """
    mean, shown = (half_a + half_b) / 2, [srgb_encode(half) for half in (half_a, half_b)]
    weights = _weights(half_a, half_b)
    kept = _kept(sum((image - mean)**2 for image in images) * weights)

    def lenses(squares: Array) -> Array:
        return _lens_means(squares * weights, kept)

    by_measure = {SSIM: np.array([1 - lens_ssims(srgb_encode(image), *shown) for image in images]),
                  RELMSE: np.array([lenses((image - half_a) * (image - half_b)) for image in images]),
                  SMAPE: np.array([_smape(image, mean) for image in images]),
                  FLIP: np.array([_flips(image, mean) for image in images])}
    if len(images) > 1:
        middle, variance = images.mean(0, dtype=np.float64), images.var(0, ddof=1, dtype=np.float64)
        by_measure[BIAS] = lenses((middle - half_a) * (middle - half_b) - variance / len(images))
        by_measure[VARIANCE] = lenses(variance)
    return by_measure


def reference_noise(half_a: Array, half_b: Array) -> dict[str, float]:
    """Return the error of each of MEASURES that the mean of two halves (n, py, px, 3) has itself, by its noise.

    One half is measured against the other. The noise of their mean has a quarter of the variance of their difference;
    so errors that grow with its square are divided by 4, the others by 2.
    """
    squares = (half_a - half_b)**2 * _weights(half_a, half_b)
    apart = {SSIM: 1 - lens_ssims(*(srgb_encode(half) for half in (half_a, half_b, half_b))),
             RELMSE: _lens_means(squares, _kept(squares)), SMAPE: _smape(half_a, half_b), FLIP: _flips(half_a, half_b)}
    return {name: float(values.mean()) / (4 if name in (SSIM, RELMSE) else 2) for name, values in apart.items()}


def lens_ssims(images: Array, half_a: Array, half_b: Array) -> Array:
    """Return the split SSIM (n,) of elemental images (n, py, px, 3) of display values."""
    return np.asarray(stacked_ssim(images, half_a, half_b).mean((1, 2)))


def _weights(half_a: Array, half_b: Array) -> Array:
    """Return what squared errors are multiplied by to be relative, (n, py, px, 1)."""
    mean = ((half_a + half_b) / 2).mean(-1, keepdims=True, dtype=np.float64)
    return np.asarray(1 / (mean**2 + RELATIVE))


def _kept(squares: Array) -> Array:
    """Return factors (n, py, px): 0 for the share TRIMMED of pixels whose ``squares`` (n, py, px, C) are largest.

    The others are as much above 1 as makes the mean of products that of the pixels that are kept.
    """
    pixels = squares.mean(-1, dtype=np.float64)
    worst = np.argsort(pixels, axis=None, kind="stable")[pixels.size - int(TRIMMED * pixels.size):]
    factors = np.full(pixels.shape, pixels.size / (pixels.size - len(worst)))
    factors.flat[worst] = 0
    return factors


def _lens_means(squares: Array, kept: Array) -> Array:
    return np.asarray((squares.mean(-1, dtype=np.float64) * kept).mean((1, 2)))


def _smape(image: Array, mean: Array) -> Array:
    return np.asarray(2 * np.abs(image - mean) / (np.abs(image) + np.abs(mean) + SMALL)).mean(
        (1, 2, 3), dtype=np.float64)


def _flips(images: Array, references: Array) -> Array:
    return np.array([flip_map(*pair).mean() for pair in zip(images, references, strict=True)])


def flip_map(image: Array, reference: Array) -> Array:
    """Return the HDR-FLIP (H, W) of a scene-linear image (H, W, 3) against another."""
    pair = [np.ascontiguousarray(values, np.float32) for values in (reference, image)]
    return np.asarray(flip_evaluator.evaluate(*pair, "HDR", inputsRGB=False, applyMagma=False, computeMeanError=True,
                                              parameters=dict(EXPOSURES))[0])[..., 0]


MAIN_METRICS = ("ssim_eia_fg", "ssim_lens_fg")  # of whole EIAs; of single lenses, which every reference has
Metrics = dict[str, float | None]  # figures by the name of the metric; None where one cannot be known


@dataclasses.dataclass(frozen=True)
class Figures:
    """Of one render and method: one value per foreground lens, or per view where views differ along one axis."""

    ssim: tuple[float, ...]  # split SSIM
    squared: tuple[float, ...]  # squared error of display values, split
    cpu_seconds: float  # of all prefilters, and of finishing the lenses
    flip: tuple[float, ...] = ()  # HDR-FLIP against the mean of the halves
    relative: tuple[float, ...] = ()  # relMSE

    @property
    def psnr(self) -> float:
        """In dB, of the mean squared error."""
        return -10 * math.log10(max(float(np.mean(self.squared)), 1e-9))


@dataclasses.dataclass(frozen=True)
class Truth:
    folder: Path

    @cached_property
    def reference(self) -> Reference:
        return Reference.read(self.folder)

    @cached_property
    def counted(self) -> Array:
        """(n,) bool: the reference's lenses that count; all of the block where views differ along one axis."""
        one_axis = not all(self.reference.frame.display.parallax)
        return self.reference.foreground | one_axis

    @cached_property
    def lenses(self) -> Array:
        """(n, 2) rows and columns of the lenses that count."""
        return self.reference.lenses[self.counted]

    @cached_property
    def halves(self) -> tuple[Array, Array]:
        """Both halves of the lenses that count, scene-linear, as ``shown``."""
        a, b = (self.shown(images[self.counted]) for images in linear_images(self.reference))
        return a, b

    @property
    def mask(self) -> Mask:
        """The foreground (sy, sx) of a reference of all lenses."""
        return self.reference.hits

    @property
    def whole(self) -> tuple[Array, Array]:
        """Both halves (H, W, 3), scene-linear."""
        return self.reference.half_a, self.reference.half_b

    def check(self, frame: Frame) -> None:
        """LfsrError unless the reference shows what a frame shows."""
        check_reference(frame, self.reference.frame)

    def shown(self, images: Array) -> Array:
        """Return elemental images (n, py, px, 3) as they are compared; decoded views of a block of lenses."""
        if all(self.reference.frame.display.parallax):
            return images
        rows = len(np.unique(self.lenses[:, 0]))
        block = images.reshape(rows, -1, images.shape[1] * images.shape[2], 3)
        return np.ascontiguousarray(np.moveaxis(block, 2, 0))

    def finished(self, render: Path, finish: Finish | str) -> Array:
        """Finish the lenses that count of a render, as ``shown``, scene-linear; nothing is written."""
        layers, frame = clean(read_layers(render / LOW_RES_FILE))[0], read_frame(render)
        low = low_resolution(layers, frame, read_world(render, frame))
        rows, columns = self.lenses.T
        mask = foreground_mask(layers, frame.rays.tiles)[rows, columns]
        finish, upscaler = ready(finish) if isinstance(finish, str) else (finish, None)
        return self.shown(finished_lenses(low, mask, finish, self.lenses, upscaler=upscaler))

    def metrics(self, image: Array, foreground: Mask | None = None) -> Metrics:
        """Return every metric of docs/reference/metrics.md of an EIA (H, W, 3), scene-linear, in view order.

        ``foreground`` (sy, sx): that which a render found, for its recall.
        """
        metrics: dict[str, Any] = compare(image, self.whole, self.reference.frame.display.lenses, self.mask)
        metrics["recall"] = None if foreground is None else recall(foreground, self.mask)
        ordered = {name: metrics[name] for name in (*METRIC_NAMES, *metrics) if name in metrics}
        return {name: finite(value) for name, value in ordered.items() if name not in ("lenses", "notes", "ci95")}

    def lens_ssim(self, image: Array) -> Array:
        """Return the split SSIM (n,) of an EIA's foreground lenses, each on its own."""
        shown = self.reference.foreground
        if not shown.any():
            return np.empty(0)
        rows, columns = self.reference.lenses[shown].T
        half_a, half_b = (srgb_encode(half[shown]) for half in linear_images(self.reference))
        images = to_elemental_images(image, self.reference.frame.display.lenses)[rows, columns]
        return lens_ssims(srgb_encode(images), half_a, half_b)


def linear_images(reference: Reference) -> tuple[Array, Array]:
    """Return both halves as scene-linear elemental images (n, py, px, 3), in the order of the ``lenses``."""
    return listed_images(reference.half_a, reference.frame), listed_images(reference.half_b, reference.frame)


def split_rms(x: Array, a: Array, b: Array) -> float:
    """Return the root mean square error without the reference's noise, 0 where noise makes the square negative."""
    return root(split_mse(x, a, b))


def split_mse(x: Array, a: Array, b: Array) -> float:
    """Return the unbiased squared error, mean of (x - a)(x - b); below 0 if noise outweighs the error."""
    return float(np.mean((x - a) * (x - b), dtype=np.float64))


def root(squared: float) -> float:
    """Return the square root of an unbiased squared error, 0 where noise made it negative."""
    return math.sqrt(max(squared, 0.0))


def finite(value: float | None) -> float | None:
    """Return a figure, None in place of infinity."""
    return value if value is not None and math.isfinite(value) else None
