"""Open Image Denoise on a whole EIA, with weights for elemental images or with its own.

The EIA is denoised, not its views: the views of a low-resolution array lie far apart, the pixels of one EI do not, so
the EIA keeps far more detail (measured). Every other EI is mirrored for it, so that neighbours meet at the same view
and the image has no edges where the scene has none (docs/results/networks.md).
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, silent
from lfsr_core.optics.rays import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.denoiser import Weights
from lfsr_core.reconstruct.methods import oidn
from lfsr_core.reconstruct.methods.oidn import CPU, Note, Wanted
from lfsr_core.reconstruct.upscaler import LowResEIA

CONTEXT = 32  # pixels around the wanted ones that the denoiser sees too
LEAST_LEFT, MOST_LOST = 0.1, 0.1  # of an elemental image's light, and fraction of those that may keep less
POOLED = 16  # pixels that the denoiser's network pools into one

Box = tuple[slice, slice]  # rows and columns of lenses


def denoise_eia(color: Array, guides: Array | None = None, *, weights: Weights | None = None, exposure: float = 0.0,
                device: Wanted = CPU, note: Note = silent) -> Array:
    """Denoise one image (H, W, 3), scene-linear >= 0; LfsrError where the library is missing or fails.

    ``guides``: albedo and normal (H, W, 6) for guided weights, None for zeros. ``weights``: they see display white as
    1; None for the library's own, which see colour alone and expose by themselves. ``exposure``: of the view
    transform in stops, for the first. ``device``, ``note``: see ``oidn.denoise``.
    """
    if reason := oidn.why_missing():
        raise LfsrError(f"Open Image Denoise is not available ({reason}): install the package pyoidn, or choose a "
                        "method without a denoiser, such as 'bilinear'")
    seen = [color]
    if weights is not None and weights.guided:
        guides = np.zeros((*color.shape[:2], 6), np.float32) if guides is None else guides
        seen += [guides[..., :3], guides[..., 3:]]
    try:
        denoised = oidn.denoise(*seen, hdr=True, quality="high", weights=None if weights is None else weights.content,
                                input_scale=None if weights is None else 2.0 ** exposure, device=device, note=note)
    except (ImportError, RuntimeError) as error:
        raise LfsrError(f"Open Image Denoise failed on an image of shape {color.shape} ({error}): "
                        "choose a method without a denoiser, such as 'bilinear'") from None
    return np.asarray(np.maximum(denoised, 0))


def denoise_low_resolution(low: LowResEIA, weights: str | Path | None = denoiser.WEIGHTS) -> LowResEIA:
    """Denoise the colour of a low-resolution EIA; the rendered colour stays in the layer "noisy".

    ``weights``: a TZA file, None for the library's own. Lenses that show only the background are left out. LfsrError
    where the file is missing or damaged.
    """
    loaded, part = None if weights is None else denoiser.load(weights), shown_part(low.color)
    notes = list(low.notes)
    images = mirrored(low.color)
    rows, columns = images[part].shape[:2]
    if rows * columns:
        guides = None
        if loaded is not None and loaded.guided and low.guides is not None:
            guides = from_elemental_images(mirrored(low.guides)[part])
        denoised = denoise_eia(from_elemental_images(images[part]), guides, weights=loaded, exposure=low.exposure,
                               device=Wanted.of(low.device, low.gpus), note=notes.append)
        made = to_elemental_images(denoised, (columns, rows))
        before, after = (each.mean((2, 3, 4)) for each in (images[part], made))
        shine, kept = before > 0, (after > LEAST_LEFT * before) & np.isfinite(after)
        lost = (shine & ~kept).sum()
        if weights is not None and Path(weights) != denoiser.WEIGHTS and lost > MOST_LOST * shine.sum():
            raise LfsrError(f"weights {weights} make {lost} of {shine.sum()} elemental images black or infinite: "
                            "their numbers overflow. Train them again, or use others")
        images[part] = made
    return dataclasses.replace(low, color=mirrored(images), noisy=low.color, notes=tuple(notes))


def denoised_opacity(low: LowResEIA, opacity: Array) -> Array:
    """Denoise the opacity (sy, sx, h, w, 3) in [0, 1] of a low-resolution EIA before a world."""
    alone = dataclasses.replace(low, color=opacity, guides=None, noisy=None, exposure=0.0)
    cleaned = np.clip(denoise_low_resolution(alone).color, 0, 1)
    # A denoiser must not spread opacity into elemental images without any.
    return np.asarray(cleaned * opacity.any((2, 3, 4), keepdims=True))


def mirrored(images: Array) -> Array:
    """Mirror the EIs (sy, sx, h, w, C) of every other row and column, so that neighbours meet at the same view.

    Applied twice, it changes nothing.
    """
    result = images.copy()
    result[1::2] = result[1::2, :, ::-1]
    result[:, 1::2] = result[:, 1::2, :, ::-1]
    return result


def shown_part(color: Array) -> Box:
    """Bounding box of the lenses whose elemental images are not constant, with CONTEXT around; it may be empty.

    ``color``: (sy, sx, h, w, C).
    """
    values, channels = color.reshape(*color.shape[:2], -1), color.shape[-1]
    varies = (values[:, :, channels:] != values[:, :, :-channels]).any(-1)
    return span(varies.any(1), color.shape[2]), span(varies.any(0), color.shape[3])


def span(wanted: Array, pixels: int) -> slice:
    """Span of the (n,) wanted lenses, of ``pixels`` each, with CONTEXT around; it may be empty.

    It starts on a multiple of POOLED pixels, so that the denoiser pools as in the whole image.
    """
    places = np.flatnonzero(wanted)
    if not len(places):
        return slice(0, 0)
    around, step = math.ceil(CONTEXT / pixels), POOLED // math.gcd(POOLED, pixels)
    return slice(max(places[0] - around, 0) // step * step, min(places[-1] + 1 + around, len(wanted)))
