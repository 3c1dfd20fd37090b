"""The contract of an upscaling method.

Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at half-pixel centres.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol, runtime_checkable

from lfsr_core.base.arrays import Array
from lfsr_core.frames.low_res import LowResEIA


@dataclasses.dataclass(frozen=True)
class Network:
    """A network that can be named as a method's upscaler."""

    description: str  # one line for menus
    upscaler: str  # "module:class" of a ``Upscaler``, called as (name, **settings)
    weights: Mapping[int, Path]  # files, by the scale that each was trained for


class Upscaler(Protocol):
    """Makes finished elemental images of a low-resolution EIA; pads them itself where it needs to."""

    @property
    def thread_safe(self) -> bool:
        """Whether several threads may call it at once."""

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs (N, h·s, w·s, 3), scene-linear RGB >= 0, of ``lenses`` (N, 2) as int (row, column)."""


@runtime_checkable
class Cleaner(Upscaler, Protocol):
    """An upscaler that interpolates EIs by a ``kernel`` after it has cleaned them."""

    @property
    def kernel(self) -> str:
        """One of ``interpolation.KERNELS``."""

    def clean(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs (N, h, w, 3) of ``lenses`` (N, 2) before interpolation, encoded as by ``encoding.encode``."""
