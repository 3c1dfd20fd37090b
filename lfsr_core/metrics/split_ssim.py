"""Errors against a noisy reference, estimated from its two independent halves.

A reference is two renders a and b with equal samples. Errors against the two halves
have no noise in common, so the mean of their product does not grow with the
reference's noise (docs/reference/metrics.md). Pixels are display values in [0, 1].
"""

from __future__ import annotations

import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.rays import to_elemental_images

SSIM_SIGMA, SSIM_WINDOW = 1.5, 11
SSIM_BORDER = SSIM_WINDOW // 2
HALF_WINDOW: Array = np.exp(-np.arange(SSIM_BORDER + 1) ** 2 / (2 * SSIM_SIGMA**2))
HALF_WINDOW = HALF_WINDOW / (2 * HALF_WINDOW.sum() - HALF_WINDOW[0])  # from its centre outwards; the whole sums to 1
SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2  # for data in [0, 1], Wang et al. 2004
BAND_ROWS = 256
STRIP_ROWS = 16  # rows whose sums fit into a core's cache


def split_ssim_map(image: Array, half_a: Array, half_b: Array) -> Array:
    """Local SSIM (H, W, C) of ``image`` against two noisy halves of one reference.

    All are (H, W, C) in [0, 1]. Gaussian window of 11 × 11, σ = 1.5, data range 1, borders mirrored. Estimates: of the
    reference's variance cov(a, b), of its squared mean mean(a) · mean(b), of its covariance with the image cov(image,
    (a + b) / 2). With a = b this is plain SSIM.
    """
    local = np.empty(image.shape, np.float64 if image.size < 1 << 26 else np.float32)
    for start in range(0, image.shape[0], BAND_ROWS):
        # Windows cross the band's edge, so the band is computed with a margin that is then cut off.
        first, end = max(0, start - SSIM_BORDER), start + BAND_ROWS
        margin = slice(first, end + SSIM_BORDER)
        x, a, b = (np.asarray(values[margin], np.float64) for values in (image, half_a, half_b))
        mean_x, mean_a, mean_b = blur(x), blur(a), blur(b)
        mean_r = (mean_a + mean_b) / 2
        variance_x: Array = blur(x * x) - mean_x * mean_x
        variance_r: Array = blur(a * b) - mean_a * mean_b
        covariance = blur(x * (a + b)) / 2 - mean_x * mean_r
        light = (2 * mean_x * mean_r + SSIM_C1) / (mean_x * mean_x + mean_a * mean_b + SSIM_C1)
        # In flat places noise can push cov(a, b) below 0, but the sum of two variances is never negative.
        band = np.divide(light * (2 * covariance + SSIM_C2), np.maximum(variance_x + variance_r, 0) + SSIM_C2)
        local[start:end] = band[start - first:end - first]
    return local


def split_ssim(image: Array, half_a: Array, half_b: Array) -> float:
    """Mean of ``split_ssim_map`` over the pixels whose window lies inside the image."""
    return mean_of(inside_border(split_ssim_map(image, half_a, half_b)))


def ssim(image: Array, reference: Array) -> float:
    """Plain SSIM of two (H, W, C) images in [0, 1]."""
    return split_ssim(image, reference, reference)


def stacked_ssim(images: Array, halves_a: Array, halves_b: Array) -> Array:
    """Local split SSIM (N, h, w) of many separate small images (N, h, w, C), mean over C."""
    count, height, width, channels = images.shape
    step, parts = max(1, 512 // channels), []  # images in one call
    for start in range(0, count, step):
        # As channels of one image, each is filtered on its own, all in one call.
        x, a, b = (np.moveaxis(stack[start:start + step], 0, 2).reshape(height, width, -1)
                   for stack in (images, halves_a, halves_b))
        local = split_ssim_map(x, a, b).reshape(height, width, -1, channels).mean(-1)
        parts.append(np.moveaxis(local, 2, 0))
    return np.concatenate(parts)


def lens_ssim(image: Array, half_a: Array, half_b: Array, lenses: tuple[int, int]) -> Array:
    """Split SSIM (sy, sx) of every elemental image of EIAs (H, W, C) on its own; ``lenses``: (sx, sy)."""
    stacks = [to_elemental_images(values, lenses) for values in (image, half_a, half_b)]
    x, a, b = (stack.reshape(-1, *stack.shape[2:]) for stack in stacks)
    return np.asarray(stacked_ssim(x, a, b).mean((1, 2), dtype=np.float64)).reshape(lenses[::-1])


def split_mse(image: Array, half_a: Array, half_b: Array) -> float:
    """Unbiased squared error, mean((x - a) · (x - b)); below 0 if noise outweighs the error."""
    return mean_of((image - half_a) * (image - half_b))


def psnr(squared_error: float) -> float | None:
    """Decibels for data in [0, 1]; None if the error is smaller than the reference can resolve."""
    return -10 * math.log10(squared_error) if squared_error > 0 else None


def inside_border(values: Array) -> Array:
    """Rows and columns whose whole SSIM window lies inside the image."""
    return values[SSIM_BORDER:-SSIM_BORDER, SSIM_BORDER:-SSIM_BORDER]


def mean_of(values: Array) -> float:
    """Mean as a float, summed in double precision."""
    return float(np.mean(values, dtype=np.float64))


def blur(values: Array) -> Array:
    """Blur a float image (H, W, C) by the window of SSIM, keeping its type; the border is mirrored with its pixel.

    Neither side may be shorter than half the window.
    """
    half = HALF_WINDOW.astype(values.dtype)
    padded = np.pad(values, ((SSIM_BORDER, SSIM_BORDER), (0, 0), (0, 0)), mode="symmetric")
    result = np.empty_like(values)
    for start in range(0, len(values), STRIP_ROWS):
        strip = padded[start:start + STRIP_ROWS + 2 * SSIM_BORDER]
        across = np.pad(_along(strip, half), ((0, 0), (SSIM_BORDER, SSIM_BORDER), (0, 0)), mode="symmetric")
        result[start:start + STRIP_ROWS] = _along(across.swapaxes(0, 1), half).swapaxes(0, 1)
    return result


def _along(padded: Array, half: Array) -> Array:
    """Weighted sum along the first axis; the result is shorter by the window less one."""
    reach = len(half) - 1
    count = len(padded) - 2 * reach
    total: Array = half[0] * padded[reach:reach + count]
    for offset in range(1, reach + 1):
        pair = padded[reach - offset:reach - offset + count] + padded[reach + offset:reach + offset + count]
        pair *= half[offset]
        total += pair
    return total
