"""A method's picture against the reference: the usual metrics, and one number per lens for paired comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.bench.paper import renders, weights
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.images.exr import read_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.eia_metrics import compare
from lfsr_core.metrics.split_ssim import split_ssim_map, stacked_ssim
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.second_stage import linear_and_mask

SHOWN = ("p", "ssim_eia", "ssim_eia_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain", "ssim_ceiling", "flip")


def foreground_share(folder: Path) -> float:
    """Share of lenses that see the foreground."""
    return float(foreground_mask(read_layers(folder / LOW_RES_FILE), read_frame(folder).rays.tiles).mean())


def measure(settings: Settings, scene: Path, folder: Path, name: str) -> dict[str, Any] | None:
    """Metrics of method ``name`` on a rendered ``folder``, and its split SSIM per foreground lens.

    None where the method's network has no weights.
    """
    method = weights.method(settings, name)
    if method is None:
        return None
    image, mask = linear_and_mask(folder, method)
    return against(Reference.read(renders.reference(settings, scene)), read_frame(folder), image, mask)


def against(reference: Reference, frame: Frame, image: np.ndarray, mask: np.ndarray) -> dict[str, Any]:
    """Metrics of an EIA (H, W, 3), scene-linear, made of ``frame`` with the foreground ``mask``."""
    check_reference(frame, reference.frame)
    metrics = compare(image, reference.half_a, reference.half_b, frame.display.lenses,
                      reference.foreground_mask(mask), reference.lens_list)
    return {"metrics": {name: metrics.get(name) for name in SHOWN}, "ci95": metrics.get("ci95", {}),
            "error": _errors(reference, image, frame.scale),
            "lens_ssim_fg": [round(float(value), 6) for value in _per_lens(reference, image)]}


def middle_lenses(reference: Reference, count: int) -> np.ndarray:
    """Indices into ``reference.lenses`` of the ``count`` foreground lenses nearest their centre, in reading order."""
    inside = np.flatnonzero(reference.foreground)
    inside = inside if len(inside) else np.arange(len(reference.lenses))
    centre = reference.lenses[inside].mean(0)
    near = np.argsort(((reference.lenses[inside] - centre) ** 2).sum(1), kind="stable")[:count]
    return inside[np.sort(near)]


def _per_lens(reference: Reference, image: np.ndarray) -> np.ndarray:
    """Split SSIM of the reference's foreground lenses, the same ones for every image.

    Windows cross into the next lens exactly where they do in ``compare``.
    """
    lenses = reference.frame.display.lenses
    if reference.lens_list is None:
        local = split_ssim_map(*(srgb_encode(pixels) for pixels in (image, reference.half_a, reference.half_b)))
        return to_elemental_images(local, lenses).mean((2, 3, 4))[reference.hits]
    rows, columns = reference.lenses[reference.foreground].T
    half_a, half_b = (half[reference.foreground] for half in reference.elemental_images())
    ours = srgb_encode(to_elemental_images(image, lenses)[rows, columns])
    return stacked_ssim(ours, half_a, half_b).mean((1, 2)) if len(rows) else np.empty(0)


def _errors(reference: Reference, image: np.ndarray, margin: int) -> dict[str, float] | None:
    """Split squared error of foreground lenses in two parts that add up: ``margin`` outermost views, and the rest."""
    if not reference.foreground.any():
        return None
    rows, columns = reference.lenses.T
    ours = srgb_encode(to_elemental_images(image, reference.frame.display.lenses)[rows, columns][reference.foreground])
    half_a, half_b = (half[reference.foreground] for half in reference.elemental_images())
    squares = ((ours - half_a) * (ours - half_b)).mean((0, 3), dtype=np.float64)
    inside = np.zeros(squares.shape, bool)
    inside[margin:-margin, margin:-margin] = True
    border, centre = (float(squares[part].sum() / squares.size) for part in (~inside, inside))
    return {"border": border, "centre": centre, "border_pixels": float((~inside).mean())}


def inputs(settings: Settings, scene: Path, name: str, **more: Any) -> dict[str, Any]:
    """What a kept measurement of accuracy depends on."""
    reference = read_frame(renders.reference(settings, scene))
    return {"scene": scene.stem, "method": name, "display": settings.display.to_dict(), "scale": settings.scale,
            "convention": settings.convention, "reference_spp": reference.samples,
            "weights": weights.fingerprints(settings, name),
            "lenses": None if reference.lens_list is None else len(reference.lens_list), **more}


def schedules(settings: Settings, names: Sequence[str]) -> dict[str, str]:
    """How the network of each method was trained; methods without one are left out."""
    return {name: weights.schedule(weights.weights(settings, part)) for name in names
            for part in MethodName.parse(name).networks}
