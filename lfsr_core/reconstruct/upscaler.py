"""The one contract of an upscaling method.

Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at half-pixel centres.
"""

from __future__ import annotations

import abc

from lfsr_core.base.arrays import Array
from lfsr_core.frames.low_res import LowResEIA


class Upscaler(abc.ABC):
    """Makes finished elemental images of a low-resolution EIA; pads them itself where it needs to."""

    thread_safe: bool = False  # whether several threads may call it at once
    follows_depth: bool = False  # whether it reads the slopes of what is seen
    kernel: str = "linear"  # of ``interpolation.KERNELS``, by which the opacity before a world is upscaled

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """Return what it is called with: ``low`` after all prefilters, and what all lenses have in common."""
        return low

    @abc.abstractmethod
    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs (N, h·s, w·s, 3), scene-linear RGB >= 0, of ``lenses`` (N, 2) as int (row, column)."""
