"""Open Image Denoise on a whole EIA.

The EIA is denoised, not its views: the views of a low-resolution array lie far apart, the pixels of one EI do not, so
the EIA keeps far more detail (measured). Where views differ along one axis only, lenses are many and views few, and
whole views, one below the other, keep more (docs/reference/displays.md). EIs without fine texture are denoised at half
the view resolution: their views are alike, and the mean of four has half the noise (docs/notebook/networks.md).
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.encoding import encode
from lfsr_core.reconstruct.methods import oidn
from lfsr_core.reconstruct.methods.guides import Guides, blend, guides_of, smooth_step
from lfsr_core.reconstruct.methods.interpolation import interpolated
from lfsr_core.reconstruct.methods.rectangles import Box, rectangles, span

LEAST_HALVED = 10  # pixels along each side of an EI from which on it may be denoised at half resolution
HALF_KERNEL = "cubic"  # from half to full resolution
# Difference between the half- and the full-resolution image, as a fraction of the removed noise: up to the first it is
# noise; from the second on half resolution lost what the guides do not show, such as a shadow's edge.
LOST = (0.25, 0.6)
VERSION = 8  # of the result: figures measured with another version are out of date


def denoise_eia(color: Array, albedo: Array | None = None, normal: Array | None = None, *,
                fast: bool = False, weights: bytes | None = None) -> Array:
    """Denoise one image (H, W, 3), scene-linear >= 0; LfsrError where the library is missing or fails.

    ``albedo`` in [0, 1] and ``normal`` in [-1, 1]: guides without noise; a normal without albedo is not used.
    ``fast``: half the time, a little less accurate. ``weights``: of ours for colour alone (``denoiser.load``), which
    see display white as 1.
    """
    if not is_available():
        raise LfsrError("Open Image Denoise is not available (neither pyoidn nor Blender's libOpenImageDenoise was "
                        "found): install the package pyoidn, or choose a method without 'oidn'")
    guides = {"albedo": albedo, "normal": normal} if albedo is not None else {}
    images = {name: np.asarray(image, np.float32) for name, image in guides.items() if image is not None}
    # With guides, "high" takes 2.5 times as long as "balanced", no better from 4 on: docs/notebook/networks.md.
    quality = "fast" if fast else "balanced" if images else "high"
    try:
        denoised = oidn.denoise(np.asarray(color, np.float32), images.get("albedo"), images.get("normal"), hdr=True,
                                clean_aux=bool(images), quality=quality, weights=weights,
                                input_scale=None if weights is None else 1)
    except (ImportError, RuntimeError) as error:
        raise LfsrError(f"Open Image Denoise failed on an image of shape {color.shape} ({error}): "
                        "choose a method without 'oidn'") from None
    return np.asarray(np.maximum(denoised, 0))


def denoise_low_resolution(low: LowResEIA, *, fast: bool = False, guided: bool = False) -> LowResEIA:
    """Denoise the colour of a low-resolution EIA; the rendered colour stays in the layer "noisy".

    ``guided``: by albedo and normal, where it has them. Lenses that show only the background are left out.
    """
    part = shown_part(low.color, low.parallax)
    guides = _guides(low, part) if guided else None
    return _replaced(low, part, _denoised(low.color[part], guides.images if guides else {}, low.parallax, fast=fast))


def denoise_with_ours(low: LowResEIA, weights: str | Path = denoiser.WEIGHTS) -> LowResEIA:
    """Denoise the colour alone with weights of ours, a TZA file; the rendered colour stays in the layer "noisy".

    Every other EI is mirrored before and after, see ``mirrored``. LfsrError where the file is missing or damaged.
    """
    content, part = denoiser.load(weights), shown_part(low.color)
    images = low.color[part]
    if not images.size:
        return _replaced(low, part, images)
    rows, columns = images.shape[:2]
    denoised = denoise_eia(from_elemental_images(mirrored(images)), weights=content)
    return _replaced(low, part, mirrored(to_elemental_images(denoised, (columns, rows))))


def mirrored(images: Array) -> Array:
    """Mirror the EIs (sy, sx, h, w, C) of every other row and column, so that neighbours meet at the same view.

    The EIA then has no edges where the scene has none. Applied twice, it changes nothing.
    """
    result = images.copy()
    result[1::2] = result[1::2, :, ::-1]
    result[:, 1::2] = result[:, 1::2, :, ::-1]
    return result


def denoise_at_half(low: LowResEIA) -> LowResEIA:
    """Denoise with guides at half the view resolution, except where the guides show detail.

    At full resolution where EIs are too small to be halved; without guides where there is no albedo.
    """
    part = shown_part(low.color, low.parallax)
    guides = _guides(low, part) if _can_be_halved(low) else None
    if guides is None:
        return denoise_low_resolution(low, guided=True)
    rendered = low.color[part]
    result = _at_half(rendered, guides)
    for found in rectangles(guides.detail > 0, (low.color.shape[2], low.color.shape[3])):
        around = {name: image[found.outer] for name, image in guides.images.items()}
        full = _denoised(rendered[found.outer], around, low.parallax)[found.crop]
        result[found.inner] = blend(result[found.inner], full, guides.detail[found.inner])
    return _replaced(low, part, result)


def denoise_both_ways(low: LowResEIA) -> LowResEIA:
    """Denoise with guides at half resolution, and at full resolution into the layer "guided".

    The half-resolution image becomes the full-resolution one where it lost detail, shown by the guides or not. Where
    EIs are too small to be halved, it is denoised without guides instead. Without albedo there is no second image.
    """
    part = shown_part(low.color, low.parallax)
    guides = _guides(low, part)
    if guides is None:
        return denoise_low_resolution(low)
    rendered = low.color[part]
    full = _denoised(rendered, guides.images, low.parallax)
    if _can_be_halved(low):
        half = _at_half(rendered, guides)
        half = blend(half, full, _detail(guides.detail, half, full, rendered))
    else:
        half = _denoised(rendered, {}, low.parallax)
    return dataclasses.replace(_replaced(low, part, half), guided=_replaced(low, part, full).color)


def mean_of_both(low: LowResEIA) -> LowResEIA:
    """Mean of the two images of ``denoise_both_ways``, for upscalers that take one.

    More accurate than either on real scenes from 4 samples on (docs/notebook/networks.md).
    """
    if low.guided is None:
        return low
    return dataclasses.replace(low, color=(low.color + low.guided) / 2, guided=None)


def _guides(low: LowResEIA, part: Box) -> Guides | None:
    denoise = functools.partial(_denoised, guides={}, parallax=low.parallax, fast=True)
    layers = {name: layer[part] for name, layer in low.layers.items()}
    return guides_of(layers, low.samples, denoise, _pixels_of_a_lens(low.color, low.parallax))


def _pixels_of_a_lens(color: Array, parallax: tuple[bool, bool]) -> tuple[int, int]:
    """(h, w) of a lens in the image that is denoised."""
    return (color.shape[2], color.shape[3]) if all(parallax) else (1, 1)


def _denoised(images: Array, guides: Mapping[str, Array], parallax: tuple[bool, bool], *,
              fast: bool = False, weights: bytes | None = None) -> Array:
    """EIs (sy, sx, h, w, 3), denoised as one image."""
    if not images.size:
        return images
    seen = {name: _as_image(guide, parallax) for name, guide in guides.items()}
    denoised = denoise_eia(_as_image(images, parallax), **seen, fast=fast, weights=weights)
    return _as_elemental_images(denoised, images.shape, parallax)


def _can_be_halved(low: LowResEIA) -> bool:
    """Whether 2×2 pixels of the EIA always belong to one EI, and EIs are large enough."""
    return all(low.parallax) and all(side % 2 == 0 and side >= LEAST_HALVED for side in low.color.shape[2:4])


def _at_half(images: Array, guides: Guides) -> Array:
    """EIs (sy, sx, h, w, 3), denoised with guides at half the resolution."""
    if not images.size:
        return images
    small = {name: _halved(guide) for name, guide in guides.images.items()}
    denoised = _denoised(_halved(images), small, (True, True))
    flat = np.ascontiguousarray(denoised).reshape(-1, *denoised.shape[2:])
    return np.maximum(interpolated(flat, HALF_KERNEL, (2, 2)), 0).reshape(images.shape)


def _halved(images: Array) -> Array:
    """Means over 2×2 pixels of EIs (sy, sx, h, w, C)."""
    rows = images[:, :, ::2] + images[:, :, 1::2]  # seven times as fast as the mean over two axes
    return np.asarray((rows[:, :, :, ::2] + rows[:, :, :, 1::2]) * np.float32(0.25))


def _detail(shown: Array, half: Array, full: Array, rendered: Array) -> Array:
    """Detail (sy, sx) in [0, 1] that the guides have ``shown``, or that was lost at ``half`` resolution."""
    result, unsure = shown.copy(), shown < 1
    half, full, rendered = (encode(images[unsure]) for images in (half, full, rendered))
    change, noise = (np.square(images - full).mean((1, 2, 3)) for images in (half, rendered))
    lost = np.divide(change, noise, out=np.zeros_like(noise), where=noise > 0)
    result[unsure] = np.maximum(result[unsure], smooth_step(lost, *LOST))
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
    h, w = _pixels_of_a_lens(color, parallax)
    return span(varies.any(1), h), span(varies.any(0), w)


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


def as_rendered(low: LowResEIA) -> LowResEIA:
    """Take the colour that Cycles denoised on its own device; LfsrError where the frame has none."""
    if low.denoised is None:
        raise LfsrError("the frame has no layer 'denoised': render it with --layers denoised, or choose the method "
                        "'oidn'")
    return dataclasses.replace(low, color=low.denoised, noisy=low.color)


def is_available() -> bool:
    """Whether this Python has pyoidn or finds Blender's library."""
    return any(oidn.find_libraries())
