"""How near an EIA is to its reference: every number of docs/reference/metrics.md.

Images are compared as plain sRGB values clipped to [0, 1], whatever the scene's
view transform. "Split" numbers cancel the reference's own noise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.intervals import stratified, stratum
from lfsr_core.metrics.split_ssim import (
    inside_border,
    lens_ssim,
    mean_of,
    psnr,
    split_mse,
    split_ssim_map,
    ssim,
    stacked_ssim,
)
from lfsr_core.optics.eia import to_elemental_images, to_views, views_per_lens

try:
    import flip_evaluator
except ImportError:  # its wheels are bound to one Python version each, so the Blender extension has none
    flip_evaluator = None

METRIC_NAMES = ("p", "ssim_eia", "ssim_eia_fg", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_views_fg",
                "ssim_eia_plain", "ssim_ceiling", "flip")
# Of a reference that shows only some lenses: windows cannot cross into lenses that it does not show.
SAMPLED_NAMES = ("p", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_lens_plain", "ssim_lens_ceiling", "flip")
NO_FLIP = "FLIP was not computed: the Python that compared has no package flip-evaluator"
LensList = tuple[tuple[int, int], ...]


def compare(image: Array, halves: tuple[Array, Array], lenses: tuple[int, int], mask: Array,
            lens_list: LensList | None = None) -> dict[str, Any]:
    """Every metric of an EIA by name; None stands for what cannot be known.

    With ``lens_list`` the numbers estimate the whole EIA from lenses drawn at random
    inside and outside the mask, and "ci95" holds the half-widths of their 95 %
    confidence intervals.

    Parameters
    ----------
    image : (H, W, 3), scene-linear, in view order
    halves : of its reference, independent of each other, scene-linear: (H, W, 3), or tiles of the listed lenses
    lenses : (sx, sy)
    mask : (sy, sx) bool, the foreground
    lens_list : (row, column) of the reference's lenses, in tiles as ``RayLayout`` places them; None for all

    Returns
    -------
    By METRIC_NAMES, with ``lens_list`` by SAMPLED_NAMES, and in the latter case "lenses" and "ci95"; without the
    package flip-evaluator "flip" is None and "notes" reports it

    Raises
    ------
    LfsrError : where shapes differ
    """
    views_per_lens(image, lenses)
    if mask.shape != lenses[::-1]:
        raise LfsrError(f"the foreground mask has shape {mask.shape}, expected {lenses[::-1]}, one entry per lens: "
                        "upscale the frame again")
    notes = {} if flip_evaluator else {"notes": [NO_FLIP]}
    if lens_list is not None:
        return _compare_sampled(image, halves, lenses, mask, lens_list) | notes
    for half in halves:
        if half.shape != image.shape:
            raise _shape_error(half.shape, image.shape)
    return _compare_whole(*(srgb_encode(values) for values in (image, *halves)), lenses, mask) | notes


def mean_flip(image: Array, reference: Array) -> float | None:
    """Mean LDR-FLIP (Andersson et al. 2020) of two (H, W, 3) sRGB images in [0, 1]; None without its package."""
    if flip_evaluator is None:
        return None
    images = [np.ascontiguousarray(values, np.float32) for values in (reference, image)]
    return float(flip_evaluator.evaluate(*images, "LDR", inputsRGB=True, applyMagma=False, computeMeanError=True)[1])


def _shape_error(reference: tuple[int, ...], image: tuple[int, ...]) -> LfsrError:
    return LfsrError(f"the reference has shape {reference}, but {image} was expected: "
                     "render the reference of the same frame")


def _compare_whole(x: Array, a: Array, b: Array, lenses: tuple[int, int],
                   mask: Array) -> dict[str, Any]:
    mean = (a + b) / 2
    px, py = views_per_lens(x, lenses)
    foreground = np.kron(mask, np.ones((py, px), bool))
    return {
        "p": mean_of(mask),
        **_ssim_of_eia(x, a, b, foreground),
        **_ssim_of_lenses(x, a, b, mask),
        "psnr_fg": psnr(split_mse(*(values[foreground] for values in (x, a, b)))) if mask.any() else None,
        "ssim_views_fg": _views_ssim(x, a, b, lenses, mask),
        "ssim_eia_plain": ssim(x, mean),
        "ssim_ceiling": ssim(a, b),
        "flip": mean_flip(x, mean),
    }


def _ssim_of_eia(x: Array, a: Array, b: Array, foreground: Array) -> dict[str, Any]:
    """Split SSIM of the whole EIA and of its ``foreground`` pixels; windows cross from lens to lens."""
    local, inside = inside_border(split_ssim_map(x, a, b)), inside_border(foreground)
    return {"ssim_eia": mean_of(local), "ssim_eia_fg": mean_of(local[inside]) if inside.any() else None}


def _ssim_of_lenses(x: Array, a: Array, b: Array, mask: Array) -> dict[str, Any]:
    """Split SSIM of elemental images each on its own, of all lenses and of those in ``mask`` (sy, sx)."""
    values = lens_ssim(x, a, b, mask.shape[::-1])
    return {"ssim_lens": mean_of(values), "ssim_lens_fg": mean_of(values[mask]) if mask.any() else None}


def _views_ssim(x: Array, a: Array, b: Array, lenses: tuple[int, int],
                mask: Array) -> float | None:
    """Split SSIM of the decoded views over foreground lenses; views are small, so their borders count."""
    if not mask.any():
        return None
    stacks = [to_views(values, lenses).reshape(-1, *mask.shape, values.shape[2]) for values in (x, a, b)]
    return mean_of(stacked_ssim(*stacks)[:, mask])


def _compare_sampled(image: Array, halves: tuple[Array, Array], lenses: tuple[int, int],
                     mask: Array, lens_list: LensList) -> dict[str, Any]:
    rows, columns = np.asarray(lens_list).T
    chosen = to_elemental_images(image, lenses)[rows, columns]
    stacks = [srgb_encode(chosen), *(srgb_encode(_tiles(half, chosen.shape)) for half in halves)]
    values = _per_lens(*stacks)
    in_foreground = mask[rows, columns]
    whole = {name: stratified(values[name], in_foreground, mask) if name in values else (None, None)
             for name in ("ssim_lens", "ssim_lens_plain", "ssim_lens_ceiling", "flip")}
    foreground = {f"{name}_fg": stratum(values[name][in_foreground], int(mask.sum())) for name in ("ssim_lens", "psnr")}
    estimates = whole | foreground
    estimates["psnr_fg"] = _decibels(*estimates["psnr_fg"])
    found = {"p": mean_of(mask)} | {name: value for name, (value, _) in estimates.items()}
    return {**{name: found[name] for name in SAMPLED_NAMES},
            "lenses": len(lens_list), "ci95": {name: width for name, (_, width) in estimates.items()}}


def _tiles(half: Array, shape: tuple[int, ...]) -> Array:
    """The first N of the (py, px) tiles of a reference, (N, py, px, C)."""
    count, py, px, channels = shape
    if half.shape[0] % py or half.shape[1] % px or half.shape[0] * half.shape[1] < count * py * px:
        raise _shape_error(half.shape, (f"{count} tiles of", py, px, channels))
    return to_elemental_images(half, (half.shape[1] // px, half.shape[0] // py)).reshape(-1, py, px, channels)[:count]


def _per_lens(x: Array, a: Array, b: Array) -> dict[str, Array]:
    """Metrics (N,) of each EI (N, py, px, C) on its own; "psnr" holds squared errors."""
    mean = (a + b) / 2
    flip = {"flip": np.array([mean_flip(*pair) for pair in zip(x, mean, strict=True)])} if flip_evaluator else {}
    return {
        "ssim_lens": stacked_ssim(x, a, b).mean((1, 2)),
        "ssim_lens_plain": stacked_ssim(x, mean, mean).mean((1, 2)),
        "ssim_lens_ceiling": stacked_ssim(a, b, b).mean((1, 2)),
        "psnr": np.mean((x - a) * (x - b), (1, 2, 3), dtype=np.float64),
    } | flip


def _decibels(error: float | None, width: float | None) -> tuple[float | None, float | None]:
    """PSNR and its half-width (first order) from a squared error and its half-width."""
    if error is None or error <= 0:
        return None, None
    return psnr(error), None if width is None else 10 / math.log(10) * width / error
