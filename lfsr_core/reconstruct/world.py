"""A visible world behind elemental images that were finished without it.

The low-resolution EIA then holds the subject alone, over black, and its opacity. The opacity is denoised and upscaled
as colour is, in the same domain, so that no dark or bright seam is left between subject and world; the world itself is
known at full resolution and without noise.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.contract import Cleaner, Upscaler
from lfsr_core.reconstruct.encoding import decode, encode
from lfsr_core.reconstruct.methods.denoise import denoise_low_resolution
from lfsr_core.reconstruct.methods.interpolation import interpolated
from lfsr_core.reconstruct.registry import Method

KERNEL = "linear"  # where an upscaler has none of its own


def prepared(low: LowResEIA, method: Method) -> LowResEIA:
    """``low`` after the prefilters of ``method``; if these denoise, the opacity is denoised too."""
    ready = method.prepare(low)
    if low.world is None:
        return ready
    if low.opacity is None or low.places is None:
        raise LfsrError("the world is known, but not the subject's opacity: render the frame again")
    if not method.name.prefilters:
        return dataclasses.replace(ready, opacity=low.opacity)
    alone = dataclasses.replace(low, color=low.opacity, guides=None, noisy=None, exposure=0.0)
    cleaned = np.clip(denoise_low_resolution(alone).color, 0, 1)
    # A denoiser must not spread opacity into elemental images without any.
    return dataclasses.replace(ready, opacity=cleaned * low.opacity.any((2, 3, 4), keepdims=True))


def finish_lenses(upscaler: Upscaler, low: LowResEIA, lenses: Array) -> Array:
    """EIs (N, h·s, w·s, 3), scene-linear, of ``lenses`` (N, 2): upscaled, before the world where there is one."""
    lenses = np.asarray(lenses)
    if low.world is None:
        return upscaler(low, lenses)
    assert low.opacity is not None, "prepared has checked it"
    images = world_behind(upscaler, low, lenses)
    rows, columns = lenses.T
    some = low.opacity[rows, columns].any((1, 2, 3)) | low.rendered[rows, columns].any((1, 2, 3))
    if some.any():
        images[some] += upscaler(low, lenses[some])
    return images


def world_behind(upscaler: Upscaler, low: LowResEIA, lenses: Array) -> Array:
    """Light of the world (N, h·s, w·s, 3), scene-linear, that passes the subject in ``lenses`` (N, 2)."""
    assert low.world is not None and low.places is not None and low.opacity is not None, "prepared has checked it"
    rows, columns = lenses.T
    images, opacity = low.world.elemental_images(low.places[rows, columns]), low.opacity[rows, columns]
    hiding = opacity.any((1, 2, 3))
    if hiding.any():
        kernel = upscaler.kernel if isinstance(upscaler, Cleaner) else KERNEL
        images[hiding] *= 1 - np.clip(decode(interpolated(encode(opacity[hiding]), kernel, low.factors)), 0, 1)
    return images
