"""The one contract that every upscaling method obeys.

Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at
half-pixel centres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA


class Upscaler(Protocol):
    """``low`` and lenses (N, 2) int (row, column) -> EIs (N, h·s, w·s, 3) float32.

    The result is scene-linear RGB >= 0 (float16 allowed). Whatever padding a
    method needs it makes itself. ``thread_safe``: may run on several lens rows at
    once. ``notes``: sentences for the report on the run so far.
    """

    name: str
    thread_safe: bool
    notes: Sequence[str]

    def __call__(self, low: LowResEIA, lenses: Array) -> Array: ...


class Cleaner(Protocol):
    """An upscaler that makes low-resolution EIs (N, h, w, 3), encoded, and then interpolates them by ``kernel``."""

    name: str
    kernel: str
    thread_safe: bool
    notes: Sequence[str]

    def clean(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs (N, h, w, 3) of the (N, 2) ``lenses`` before interpolation, encoded."""
