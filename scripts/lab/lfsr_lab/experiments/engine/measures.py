"""Errors of elemental images against the two halves of a reference: the one place of all studies.

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

import flip_evaluator
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.split_ssim import stacked_ssim

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
    return {SSIM: np.array([1 - lens_ssims(srgb_encode(image), *shown) for image in images]),
            **_relative(images, half_a, half_b),
            SMAPE: np.array([_smape(image, mean) for image in images]),
            FLIP: np.array([_flips(image, mean) for image in images])}


def reference_noise(half_a: Array, half_b: Array) -> dict[str, float]:
    """Return the error of each of MEASURES that the mean of two halves (n, py, px, 3) has itself, by its noise.

    One half is measured against the other. The noise of their mean has a quarter of the variance of their difference;
    so errors that grow with its square are divided by 4, the others by 2.
    """
    squares = (half_a - half_b)**2 * _weights(half_a, half_b)
    apart = {SSIM: 1 - lens_ssims(*(srgb_encode(half) for half in (half_a, half_b, half_b))),
             RELMSE: _lens_means(squares, _kept(squares)),
             SMAPE: _smape(half_a, half_b), FLIP: _flips(half_a, half_b)}
    return {name: float(values.mean()) / (4 if name in (SSIM, RELMSE) else 2) for name, values in apart.items()}


def lens_ssims(images: Array, half_a: Array, half_b: Array) -> Array:
    """Return the split SSIM (n,) of elemental images (n, py, px, 3) of display values."""
    return np.asarray(stacked_ssim(images, half_a, half_b).mean((1, 2)))


def _relative(images: Array, half_a: Array, half_b: Array) -> dict[str, Array]:
    """Return the relative squared error (seeds, n), and its parts (n,) where there are two or more seeds."""
    weights, mean = _weights(half_a, half_b), (half_a + half_b) / 2
    kept = _kept(sum((image - mean)**2 for image in images) * weights)

    def lenses(squares: Array) -> Array:
        return _lens_means(squares * weights, kept)

    found = {RELMSE: np.array([lenses((image - half_a) * (image - half_b)) for image in images])}
    if len(images) > 1:
        middle, variance = images.mean(0, dtype=np.float64), images.var(0, ddof=1, dtype=np.float64)
        found[BIAS] = lenses((middle - half_a) * (middle - half_b) - variance / len(images))
        found[VARIANCE] = lenses(variance)
    return found


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
