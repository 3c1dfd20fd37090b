"""95 % intervals of metrics over all lenses of a whole reference.

Nothing is sampled here: the interval tells how far a metric would move with another subject of the same kind, if its
lenses were drawn like these. Neighbouring lenses see nearly the same, so they are drawn in blocks.
"""

from __future__ import annotations

import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.intervals import student_95
from lfsr_core.metrics.split_ssim import lens_ssim, split_ssim_map
from lfsr_core.optics.eia import to_elemental_images

BLOCK = 3  # lenses along each side


def lens_intervals(image: Array, half_a: Array, half_b: Array, lenses: tuple[int, int],
                   mask: Array) -> dict[str, float | None]:
    """Half-widths of the 95 % intervals of SSIM and psnr_fg (in dB, first order), from whole images.

    Parameters
    ----------
    image, half_a, half_b : (H, W, 3), scene-linear, in view order
    lenses : (sx, sy)
    mask : (sy, sx) bool, the foreground

    Returns
    -------
    By name; None where fewer than two blocks of lenses take part
    """
    x, a, b = (srgb_encode(values) for values in (image, half_a, half_b))
    maps = {"ssim_eia": _per_lens(split_ssim_map(x, a, b), lenses), "ssim_lens": lens_ssim(x, a, b, lenses)}
    masks = {"": np.ones_like(mask), "_fg": mask}
    error = _per_lens((x - a) * (x - b), lenses)
    mean_error, width = block_interval(error, mask)
    decibels = 10 / math.log(10) * width / mean_error if width is not None and mean_error > 0 else None
    return {name + end: block_interval(values, where)[1] for name, values in maps.items()
            for end, where in masks.items()} | {"psnr_fg": decibels}


def block_interval(values: Array, mask: Array) -> tuple[float, float | None]:
    """Mean of ``values`` (sy, sx) over ``mask`` and its 95 % half-width from blocks of BLOCK × BLOCK lenses.

    A ratio estimate: blocks count by how many of their lenses are in the mask.
    """
    counts, sums = _blocks(mask.astype(float)), _blocks(np.where(mask, values, 0.0))
    used = counts > 0
    number, total = int(used.sum()), counts.sum()
    mean = float(sums.sum() / total) if total else math.nan
    if number < 2:
        return mean, None
    residual = (sums - mean * counts)[used]
    error = math.sqrt(number / (number - 1) * float(residual @ residual)) / total
    return mean, student_95(number - 1) * error


def _per_lens(values: Array, lenses: tuple[int, int]) -> Array:
    """Means (sy, sx) of the elemental images of (H, W, C)."""
    return to_elemental_images(values, lenses).mean(axis=(2, 3, 4), dtype=np.float64)


def _blocks(values: Array) -> Array:
    """Sums over blocks, flat."""
    padded = np.pad(values, [(0, -size % BLOCK) for size in values.shape])
    rows, columns = (size // BLOCK for size in padded.shape)
    return padded.reshape(rows, BLOCK, columns, BLOCK).sum((1, 3)).ravel()
