"""Open Image Denoise on a whole EIA.

The EIA, not decoded views: views of the low-resolution array lie far apart, the
pixels inside one EI do not, so the EIA keeps far more detail (measured). Where
views differ along one axis only the lenses are many and the views few, and whole
views, one under the other, keep more (docs/reference/displays.md). And at half
the resolution inside each elemental image, where that holds no fine texture: its
views are alike, and a denoiser that sees four of them at once has half the noise
(docs/results/networks.md).
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping
from types import ModuleType

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct.encoding import encode
from lfsr_core.reconstruct.methods import oidn
from lfsr_core.reconstruct.methods.guides import Cleaner, Guides, guides_of, smooth_step
from lfsr_core.reconstruct.methods.rectangles import Box, rectangles, span
from lfsr_core.reconstruct.methods.shear import interpolated

LEAST_HALVED = 10  # pixels along each side of an EI from which on it may be denoised at half the resolution
HALF_KERNEL = "cubic"  # from half the resolution to the whole
# Share of the noise taken away by which the picture at half the resolution may differ from the whole one: up to the
# first that is noise, from the second on it lost what the guides do not show, as a shadow's edge.
LOST = (0.25, 0.6)
VERSION = 8  # of what comes out: figures measured with another one are out of date


def denoise_eia(color: Array, albedo: Array | None = None, normal: Array | None = None, *,
                fast: bool = False) -> Array:
    """One denoised image.

    Parameters
    ----------
    color : (H, W, 3), scene-linear >= 0, any range
    albedo : (H, W, 3) in [0, 1], noise-free, guides where present
    normal : (H, W, 3) in [-1, 1], noise-free, counts only together with an albedo, as the library asks
    fast : half the time, a little less accurate

    Returns
    -------
    (H, W, 3) float32, scene-linear >= 0

    Raises
    ------
    LfsrError : where the library is missing or fails
    """
    guides = {"albedo": albedo, "normal": normal} if albedo is not None else {}
    guides = {name: np.asarray(image, np.float32) for name, image in guides.items() if image is not None}
    # With guides, "high" takes 2.5 times as long as "balanced", no better from 4 on: docs/results/networks.md.
    quality = "fast" if fast else "balanced" if guides else "high"
    try:
        denoised = _library().denoise(np.asarray(color, np.float32), **guides, hdr=True, clean_aux=bool(guides),
                                      quality=quality)
    except (ImportError, RuntimeError) as error:
        raise LfsrError(f"Open Image Denoise failed on an image of shape {color.shape} ({error}): "
                        "choose a method without 'oidn'") from None
    return np.maximum(denoised, 0)


def denoise_low_resolution(low: LowResEIA, *, fast: bool = False, guided: bool = False) -> LowResEIA:
    """The low-resolution EIA with denoised colour; what was rendered stays in the layer "noisy".

    ``guided``: by its albedo and normal, where it has them. Only the rectangle of lenses that shows anything is
    denoised.
    """
    part = shown_part(low.color, low.parallax)
    guides = _guides(low, part) if guided else None
    return _replaced(low, part, _denoised(low.color[part], guides.images if guides else {}, low.parallax, fast=fast))


def denoise_at_half(low: LowResEIA) -> LowResEIA:
    """The same, guided, at half the resolution inside each EI, a quarter of the work, but where the guides show detail.

    At full resolution where EIs are too small to be halved, unguided where there is no albedo.
    """
    part = shown_part(low.color, low.parallax)
    guides = _guides(low, part) if _can_be_halved(low) else None
    if guides is None:
        return denoise_low_resolution(low, guided=True)
    rendered = low.color[part]
    result = _at_half(rendered, guides)
    for found in rectangles(guides.detail > 0, low.color.shape[2:4]):
        whole = _denoised(rendered[found.outer], guides.part(found.outer), low.parallax)[found.crop]
        result[found.inner] = _mixed(result[found.inner], whole, guides.detail[found.inner])
    return _replaced(low, part, result)


def denoise_both_ways(low: LowResEIA) -> LowResEIA:
    """``denoise_at_half``, whole also where that lost what no guide shows, and whole everywhere as the layer "guided".

    Where EIs are too small to be halved, without guides instead; no second picture where there is no albedo.
    """
    part = shown_part(low.color, low.parallax)
    guides = _guides(low, part)
    if guides is None:
        return denoise_low_resolution(low)
    rendered = low.color[part]
    whole = _denoised(rendered, guides.images, low.parallax)
    if _can_be_halved(low):
        half = _at_half(rendered, guides)
        half = _mixed(half, whole, _detail(guides.detail, half, whole, rendered))
    else:
        half = _denoised(rendered, {}, low.parallax)
    return dataclasses.replace(_replaced(low, part, half), guided=_replaced(low, part, whole).color)


def mean_of_both(low: LowResEIA) -> LowResEIA:
    """One picture of the two of ``denoise_both_ways``, for what takes one: their mean.

    Nearer than either on real scenes from 4 samples on (docs/results/networks.md).
    """
    if low.guided is None:
        return low
    return dataclasses.replace(low, color=(low.color + low.guided) / 2, guided=None)


def _guides(low: LowResEIA, part: Box) -> Guides | None:
    clean = functools.partial(_denoised, guides={}, parallax=low.parallax, fast=True)
    pixels = low.color.shape[2:4] if all(low.parallax) else (1, 1)
    return guides_of({name: layer[part] for name, layer in low.layers.items()}, low.samples, Cleaner(clean, pixels))


def _denoised(images: Array, guides: Mapping[str, Array], parallax: tuple[bool, bool], *,
              fast: bool = False) -> Array:
    """EIs (sy, sx, h, w, 3) as one image."""
    if not images.size:
        return images
    seen = {name: _as_image(guide, parallax) for name, guide in guides.items()}
    return _as_elemental_images(denoise_eia(_as_image(images, parallax), **seen, fast=fast), images.shape, parallax)


def _can_be_halved(low: LowResEIA) -> bool:
    """Whether 2×2 pixels of the EIA are always of one EI, and these are not too small for that."""
    return all(low.parallax) and all(side % 2 == 0 and side >= LEAST_HALVED for side in low.color.shape[2:4])


def _at_half(images: Array, guides: Guides) -> Array:
    """EIs (sy, sx, h, w, 3), denoised by their guides at half the resolution."""
    if not images.size:
        return images
    small = {name: _halved(guide) for name, guide in guides.images.items()}
    denoised = _denoised(_halved(images), small, (True, True))
    flat = np.ascontiguousarray(denoised).reshape(-1, *denoised.shape[2:])
    return np.maximum(interpolated(flat, HALF_KERNEL, (2, 2)), 0).reshape(images.shape)


def _halved(images: Array) -> Array:
    """Means over 2×2 pixels of EIs (sy, sx, h, w, C)."""
    rows = images[:, :, ::2] + images[:, :, 1::2]  # seven times as fast as the mean over two axes
    return (rows[:, :, :, ::2] + rows[:, :, :, 1::2]) * np.float32(0.25)


def _mixed(half: Array, whole: Array, detail: Array) -> Array:
    """Of EIs at half and at whole resolution the second where ``detail`` (sy, sx) is 1."""
    return half + detail[:, :, None, None, None] * (whole - half)


def _detail(shown: Array, half: Array, whole: Array, rendered: Array) -> Array:
    """(sy, sx) in [0, 1]: detail that is ``shown`` by guides, or that ``half`` the resolution lost without them."""
    result, unsure = shown.copy(), shown < 1
    lost = _lost(half[unsure], whole[unsure], rendered[unsure])
    result[unsure] = np.maximum(result[unsure], smooth_step(lost, *LOST))
    return result


def _lost(half: Array, whole: Array, rendered: Array) -> Array:
    """(N,) squares of what two pictures of EIs (N, h, w, 3) differ by, per those of the noise taken away, in √light."""
    half, whole, rendered = (encode(images) for images in (half, whole, rendered))
    noise = np.square(rendered - whole).mean((1, 2, 3))
    return np.divide(np.square(half - whole).mean((1, 2, 3)), noise, out=np.zeros_like(noise), where=noise > 0)


def _replaced(low: LowResEIA, part: Box, images: Array) -> LowResEIA:
    """``low`` with denoised EIs in one part."""
    color = low.color.copy()
    color[part] = images
    return dataclasses.replace(low, color=color, noisy=low.color)


def shown_part(color: Array, parallax: tuple[bool, bool] = (True, True)) -> Box:
    """Rows and columns of lenses that hold every EI of ``color`` (sy, sx, h, w, C) that is not of one value.

    With CONTEXT around; empty where all are. ``parallax``: as of LowResEIA.
    """
    values, channels = color.reshape(*color.shape[:2], -1), color.shape[-1]
    varies = (values[:, :, channels:] != values[:, :, :-channels]).any(-1)
    h, w = color.shape[2:4] if all(parallax) else (1, 1)  # pixels of the image that a lens takes
    return span(varies.any(1), h), span(varies.any(0), w)


def _as_image(images: Array, parallax: tuple[bool, bool]) -> Array:
    """EIs (sy, sx, h, w, C) in the order in which they are denoised: the EIA, or views one under the other."""
    if all(parallax):
        return from_elemental_images(images)
    sy, sx, h, w, channels = images.shape
    return images.transpose(2, 3, 0, 1, 4).reshape(h * w * sy, sx, channels)


def _as_elemental_images(image: Array, shape: tuple[int, ...], parallax: tuple[bool, bool]) -> Array:
    """``_as_image`` undone; ``shape`` (sy, sx, h, w, C)."""
    sy, sx, h, w, channels = shape
    if all(parallax):
        return to_elemental_images(image, (sx, sy))
    return image.reshape(h, w, sy, sx, channels).transpose(2, 3, 0, 1, 4)


def as_rendered(low: LowResEIA) -> LowResEIA:
    """The colour that Cycles denoised on its own device; LfsrError where the frame was rendered without."""
    if low.denoised is None:
        raise LfsrError("the frame has no layer denoised: render it with --layers denoised, "
                        "or choose the method 'oidn'")
    return dataclasses.replace(low, color=low.denoised, noisy=low.color)


def is_available() -> bool:
    """True if this Python has pyoidn or finds Blender's library."""
    return importlib.util.find_spec("pyoidn") is not None or oidn.find_library() is not None


@contextlib.contextmanager
def _hidden(package: str) -> Iterator[None]:
    """Imports do not find ``package`` meanwhile, unless it is loaded already.

    pyoidn imports PyTorch where it is installed, for tensors that it never gets
    here: a second and 0.2 GiB.
    """
    absent = package not in sys.modules
    if absent:
        sys.modules[package] = None
    try:
        yield
    finally:
        if absent:
            del sys.modules[package]


def _library() -> ModuleType:
    """The package pyoidn, else Blender's library; they give the same image."""
    try:
        with _hidden("torch"):
            return importlib.import_module("pyoidn")
    except ImportError as error:
        if oidn.find_library() is not None:
            return oidn
        raise LfsrError(f"Open Image Denoise is not available ({error}): install the package pyoidn, "
                        "or choose a method without 'oidn'") from None
