"""Open Image Denoise on a whole EIA.

The EIA, not decoded views: views of the low-resolution array lie far apart, the
pixels inside one EI do not, so the EIA keeps far more detail (measured). Where
views differ along one axis only the lenses are many and the views few, and whole
views, one under the other, keep more (docs/reference/displays.md). Colour
alone: a pixel of an EIA covers a whole lens, so albedo and normal are noisy too,
and as guides they take away more than they give (docs/results/networks.md).
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import importlib.util
import math
import sys
from collections.abc import Iterator, Mapping
from types import ModuleType

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct.methods import oidn

GUIDES = ("albedo", "normal")
CONTEXT = 32  # pixels around what is denoised that the library may look at
POOLED = 16  # pixels that the library's network pools into one
VERSION = 5  # of what comes out: figures measured with another one are out of date


def denoise_eia(color: np.ndarray, albedo: np.ndarray | None = None, normal: np.ndarray | None = None, *,
                fast: bool = False) -> np.ndarray:
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


def clean_guides(guides: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Noisy "albedo" and "normal" (H, W, 3) without their noise, each as an image of its own."""
    cleaned = {}
    if "albedo" in guides:
        # Cycles adds emission to it.
        cleaned["albedo"] = denoise_eia(np.clip(guides["albedo"], 0, 1), fast=True)
    if "normal" in guides:
        cleaned["normal"] = denoise_eia(np.clip(guides["normal"], -1, 1) / 2 + 0.5, fast=True) * 2 - 1
    return cleaned


def denoise_low_resolution(low: LowResEIA, *, fast: bool = False, guided: bool = False) -> LowResEIA:
    """The low-resolution EIA with denoised colour; what was rendered stays in the layer "noisy".

    ``guided``: by its albedo and normal, cleaned first, where it has them. Only the
    rectangle of lenses that shows anything is denoised.
    """
    part = shown_part(low.color, low.parallax)
    guides = [name for name in GUIDES if guided and name in low.layers]
    layers = {name: _as_image(low.layers[name][part], low.parallax) for name in guides}
    rendered = low.color[part]
    color = low.color.copy()
    if rendered.size:
        denoised = denoise_eia(_as_image(rendered, low.parallax), **clean_guides(layers), fast=fast)
        color[part] = _as_elemental_images(denoised, rendered.shape, low.parallax)
    return dataclasses.replace(low, color=color, noisy=low.color)


def shown_part(color: np.ndarray, parallax: tuple[bool, bool] = (True, True)) -> tuple[slice, slice]:
    """Rows and columns of lenses that hold every EI of ``color`` (sy, sx, h, w, C) that is not of one value.

    With CONTEXT around; empty where all are. ``parallax``: as of LowResEIA.
    """
    pixels = color.reshape(*color.shape[:2], -1, color.shape[-1])
    varies = (pixels.max(2) > pixels.min(2)).any(-1)
    h, w = color.shape[2:4] if all(parallax) else (1, 1)  # pixels of the image that a lens takes
    return span(varies.any(1), h), span(varies.any(0), w)


def _as_image(images: np.ndarray, parallax: tuple[bool, bool]) -> np.ndarray:
    """EIs (sy, sx, h, w, C) in the order in which they are denoised: the EIA, or views one under the other."""
    if all(parallax):
        return from_elemental_images(images)
    sy, sx, h, w, channels = images.shape
    return images.transpose(2, 3, 0, 1, 4).reshape(h * w * sy, sx, channels)


def _as_elemental_images(image: np.ndarray, shape: tuple[int, ...], parallax: tuple[bool, bool]) -> np.ndarray:
    """``_as_image`` undone; ``shape`` (sy, sx, h, w, C)."""
    sy, sx, h, w, channels = shape
    if all(parallax):
        return to_elemental_images(image, (sx, sy))
    return image.reshape(h, w, sy, sx, channels).transpose(2, 3, 0, 1, 4)


def span(wanted: np.ndarray, pixels: int) -> slice:
    """The (n,) wanted lenses, of ``pixels`` each, with CONTEXT around.

    It begins where the library pools as in the whole image.
    """
    places = np.flatnonzero(wanted)
    if not len(places):
        return slice(0, 0)
    around, step = math.ceil(CONTEXT / pixels), POOLED // math.gcd(POOLED, pixels)
    return slice(max(places[0] - around, 0) // step * step, min(places[-1] + 1 + around, len(wanted)))


def denoise_both_ways(low: LowResEIA) -> LowResEIA:
    """``denoise_low_resolution`` without guides, and with them as the layer "guided" where the frame has any."""
    plain = denoise_low_resolution(low)
    if not low.layers.keys() & set(GUIDES):
        return plain
    return dataclasses.replace(plain, guided=denoise_low_resolution(low, guided=True).color)


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
