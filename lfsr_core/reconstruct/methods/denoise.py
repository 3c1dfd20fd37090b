"""Open Image Denoise on a whole EIA, with weights for elemental images or with its own.

The EIA is denoised, not its views: the views of a low-resolution array lie far apart, the pixels of one EI do not, so
the EIA keeps far more detail (measured). Where views differ along one axis only, lenses are many and views few, and
whole views, one below the other, keep more (docs/reference/displays.md).
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.methods import oidn

CONTEXT = 32  # pixels around the wanted ones that the denoiser sees too
POOLED = 16  # pixels that the denoiser's network pools into one
VERSION = 8  # of the result: figures measured with another version are out of date

Box = tuple[slice, slice]  # rows and columns of lenses


def denoise_eia(color: Array, *, fast: bool = False, weights: bytes | None = None) -> Array:
    """Denoise one image (H, W, 3), scene-linear >= 0, from its colour; LfsrError where the library is missing or fails.

    ``weights``: of ``denoiser.load``, which see display white as 1; None for the library's own, which expose by
    themselves. ``fast``: those in half the time, a little less accurate.
    """
    if not is_available():
        raise LfsrError("Open Image Denoise is not available (neither pyoidn nor Blender's libOpenImageDenoise was "
                        "found): install the package pyoidn, or choose a method without a denoiser, such as 'bilinear'")
    try:
        denoised = oidn.denoise(np.asarray(color, np.float32), hdr=True, quality="fast" if fast else "high",
                                weights=weights, input_scale=None if weights is None else 1)
    except (ImportError, RuntimeError) as error:
        raise LfsrError(f"Open Image Denoise failed on an image of shape {color.shape} ({error}): "
                        "choose a method without a denoiser, such as 'bilinear'") from None
    return np.asarray(np.maximum(denoised, 0))


def denoise_low_resolution(low: LowResEIA, *, fast: bool = False) -> LowResEIA:
    """Denoise the colour of a low-resolution EIA by the library's own weights; that rendered stays in "noisy".

    ``fast``: see ``denoise_eia``. Lenses that show only the background are left out.
    """
    part = shown_part(low.color, low.parallax)
    images = low.color[part]
    if images.size:
        image = denoise_eia(_as_image(images, low.parallax), fast=fast)
        images = _as_elemental_images(image, images.shape, low.parallax)
    return _replaced(low, part, images)


def denoise_elemental_images(low: LowResEIA, weights: str | Path = denoiser.WEIGHTS) -> LowResEIA:
    """Denoise the colour of a low-resolution EIA by weights for that, a TZA file; that rendered stays in "noisy".

    Every other EI is mirrored before and after, see ``mirrored``. LfsrError where the file is missing or damaged.
    """
    content, part = denoiser.load(weights), shown_part(low.color)
    images = low.color[part]
    if images.size:
        rows, columns = images.shape[:2]
        image = denoise_eia(from_elemental_images(mirrored(images)), weights=content)
        images = mirrored(to_elemental_images(image, (columns, rows)))
    return _replaced(low, part, images)


def mirrored(images: Array) -> Array:
    """Mirror the EIs (sy, sx, h, w, C) of every other row and column, so that neighbours meet at the same view.

    The EIA then has no edges where the scene has none. Applied twice, it changes nothing.
    """
    result = images.copy()
    result[1::2] = result[1::2, :, ::-1]
    result[:, 1::2] = result[:, 1::2, :, ::-1]
    return result


def _replaced(low: LowResEIA, part: Box, images: Array) -> LowResEIA:
    """``low`` with denoised EIs in one part."""
    color = low.color.copy()
    color[part] = images
    return dataclasses.replace(low, color=color, noisy=low.color)


def shown_part(color: Array, parallax: tuple[bool, bool] = (True, True)) -> Box:
    """Bounding box of the lenses whose elemental images are not constant, with CONTEXT around; it may be empty.

    ``color``: (sy, sx, h, w, C). ``parallax``: see LowResEIA.
    """
    values, channels = color.reshape(*color.shape[:2], -1), color.shape[-1]
    varies = (values[:, :, channels:] != values[:, :, :-channels]).any(-1)
    h, w = color.shape[2:4] if all(parallax) else (1, 1)
    return span(varies.any(1), h), span(varies.any(0), w)


def span(wanted: Array, pixels: int) -> slice:
    """Span of the (n,) wanted lenses, of ``pixels`` each, with CONTEXT around; it may be empty.

    It starts on a multiple of POOLED pixels, so that the denoiser pools as in the whole image.
    """
    places = np.flatnonzero(wanted)
    if not len(places):
        return slice(0, 0)
    around, step = math.ceil(CONTEXT / pixels), POOLED // math.gcd(POOLED, pixels)
    return slice(max(places[0] - around, 0) // step * step, min(places[-1] + 1 + around, len(wanted)))


def _as_image(images: Array, parallax: tuple[bool, bool]) -> Array:
    """Arrange EIs (sy, sx, h, w, C) for the denoiser: as the EIA, or as views one below the other."""
    if all(parallax):
        return from_elemental_images(images)
    sy, sx, h, w, channels = images.shape
    return images.transpose(2, 3, 0, 1, 4).reshape(h * w * sy, sx, channels)


def _as_elemental_images(image: Array, shape: tuple[int, ...], parallax: tuple[bool, bool]) -> Array:
    """Inverse of ``_as_image``; ``shape``: (sy, sx, h, w, C)."""
    sy, sx, h, w, channels = shape
    if all(parallax):
        return to_elemental_images(image, (sx, sy))
    return image.reshape(h, w, sy, sx, channels).transpose(2, 3, 0, 1, 4)


def is_available() -> bool:
    """Whether this Python has pyoidn or finds Blender's library."""
    return any(oidn.find_libraries())
