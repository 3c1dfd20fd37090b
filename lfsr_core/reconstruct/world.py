"""A visible world behind elemental images that were finished without it.

The low-resolution EIA then holds the subject alone, before black, and what it hides of the world. That share is
cleaned and upscaled as the colour is, in the same domain, so that neither a dark nor a bright seam is left where
they meet; the world itself is known at full resolution and without noise.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.contract import Upscaler
from lfsr_core.reconstruct.encoding import encode
from lfsr_core.reconstruct.methods.denoise import denoise_low_resolution
from lfsr_core.reconstruct.methods.interpolation import interpolate
from lfsr_core.reconstruct.registry import Method

KERNEL = "linear"  # where an upscaler has none of its own


def prepared(low: LowResEIA, method: Method) -> LowResEIA:
    """``low`` after the prefilters of ``method``, what it hides of a world cleaned too if they denoise."""
    ready = method.prepare(low)
    if low.world is None:
        return ready
    if low.opacity is None or low.places is None:
        raise LfsrError("the world is known, but not what the subject hides of it: render the frame again")
    return dataclasses.replace(ready, opacity=_cleaned(low) if method.name.prefilters else low.opacity)


def _cleaned(low: LowResEIA) -> Array:
    alone = dataclasses.replace(low, color=low.opacity, noisy=None)
    cleaned = np.clip(denoise_low_resolution(alone, fast=True).color, 0, 1)
    # Nothing is there that a denoiser could spread into them.
    return cleaned * low.opacity.any((2, 3, 4), keepdims=True)


@dataclasses.dataclass(frozen=True)
class BeforeWorld:
    """An ``upscaler`` whose elemental images the world is put behind."""

    upscaler: Upscaler

    @property
    def name(self) -> str:
        """That of the upscaler, as all that follows."""
        return self.upscaler.name

    @property
    def thread_safe(self) -> bool:
        """See ``contract.Upscaler``."""
        return self.upscaler.thread_safe

    @property
    def notes(self) -> Sequence[str]:
        """See ``contract.Upscaler``."""
        return self.upscaler.notes

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs of ``lenses`` (N, 2), (N, h·s, w·s, 3) scene-linear, before the world where there is one."""
        lenses = np.asarray(lenses)
        if low.world is None:
            return self.upscaler(low, lenses)
        images = self.behind(low, lenses)
        rows, columns = lenses.T
        some = low.opacity[rows, columns].any((1, 2, 3)) | low.rendered[rows, columns].any((1, 2, 3))
        if some.any():
            images[some] += self.upscaler(low, lenses[some])
        return images

    def behind(self, low: LowResEIA, lenses: Array) -> Array:
        """What of the world shows past the subject in ``lenses`` (N, 2), (N, h·s, w·s, 3) scene-linear."""
        rows, columns = lenses.T
        images, opacity = low.world.elemental_images(low.places[rows, columns]), low.opacity[rows, columns]
        hiding = opacity.any((1, 2, 3))
        if hiding.any():
            images[hiding] *= 1 - self._upscaled(opacity[hiding], low)
        return images

    def _upscaled(self, opacity: Array, low: LowResEIA) -> Array:
        hidden = np.empty((len(opacity), *low.finished_views, 3), np.float32)
        interpolate(encode(opacity), getattr(self.upscaler, "kernel", KERNEL), low.factors, hidden)
        return np.clip(hidden, 0, 1, out=hidden)
