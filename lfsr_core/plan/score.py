"""Accuracy of a method on sampled lenses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.low_res import foreground_mask, low_resolution, read_world
from lfsr_core.frames.reference import listed_images, read_half
from lfsr_core.images.exr import read_finite
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.split_ssim import stacked_ssim
from lfsr_core.plan.sample import Mosaic
from lfsr_core.reconstruct.second_stage import finished_lenses

CORRECTED = 0.5  # fraction of the loss by the reference's remaining noise that is added to the metric

Quarters = Sequence[Array]  # four independent renders of the sampled lenses (n, py, px, 3), scene-linear


def read_quarters(paths: Sequence[Path], frame: Frame, count: int) -> tuple[Quarters, Array]:
    """Read the quarters of a reference of ``count`` lenses, which ``frame`` describes, and which lenses (n,) show
    any foreground."""
    images, hits = zip(*(read_half(path, frame) for path in paths), strict=True)
    shown: Array = np.any(hits, 0).reshape(-1)[:count]
    return [listed_images(image, frame)[:count] for image in images], shown


def scores(folder: Path, name: str, mosaic: Mosaic, quarters: Quarters) -> Array:
    """Accuracy (n,) of the method ``name`` on each sampled lens, from a render of them and their neighbours."""
    frame = read_frame(folder)
    layers, _ = read_finite(folder / LOW_RES_FILE)
    low = mosaic.of_render(low_resolution(layers, frame, read_world(folder, frame)))
    mask = mosaic.of_mask(foreground_mask(layers, frame.rays.tiles))
    images = finished_lenses(low, mask, name, mosaic.centres, block=mosaic.side)
    return split_scores(srgb_encode(images), quarters)


def split_scores(images: Array, quarters: Quarters) -> Array:
    """Split SSIM (n,) of images (n, py, px, 3) in [0, 1], corrected for the noise of the reference.

    That noise lowers the metric about in proportion to its variance. So what the metric gains from halves of one
    quarter to halves of two is missing once more. CORRECTED of that gain is added: adding all of it would sometimes
    promise too much (docs/notebook/plan.md).
    """
    def ssim(first: Sequence[int], second: Sequence[int]) -> Array:
        half_a, half_b = (srgb_encode(np.mean([quarters[n] for n in half], 0)) for half in (first, second))
        means: Array = stacked_ssim(images, half_a, half_b).mean((1, 2))
        return means

    full, less = ssim((0, 1), (2, 3)), (ssim((0,), (2,)) + ssim((1,), (3,))) / 2
    # Strong noise, whose variances are cut off at 0, raises the metric: then there is no gain to extrapolate.
    corrected: Array = full + CORRECTED * (full - less) if np.mean(full - less) > 0 else full
    return corrected
