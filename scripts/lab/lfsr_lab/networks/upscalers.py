"""Comparators as upscalers.

They were trained on photographs, so they see sRGB values clipped to [0, 1]: highlights above 1 are lost.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.upscaler import Upscaler
from lfsr_lab.networks.engine import Engine
from lfsr_lab.networks.networks import load

# Reach of the widest comparator (FSRCNN: 5×5, four 3×3 and 9×9 at stride s) in low-resolution pixels.
RECEPTIVE_RADIUS = 11
ROWS_AT_ONCE = 8


class PhotographUpscaler(Upscaler):
    """A network trained on photographs, applied to each EI on its own.

    ``notes``: sentences on its calls. ``thread_safe`` is False: the engine uses every core itself.
    """

    def __init__(self, name: str, *, weights: str | Path | None = None, device: str = "auto") -> None:
        self.name = name
        self.notes: list[str] = []
        self._weights, self._device = weights, device
        self._engines: dict[int, Engine] = {}

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """Return ``low``; LfsrError where its views differ along one axis."""
        if not all(low.parallax):
            raise LfsrError(f"network {self.name!r} needs views in two directions, but this display has one: choose a "
                            "method without a network")
        return low

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """Return the EIs of ``lenses`` (N, 2), (N, h·s, w·s, 3) float32 scene-linear in [0, 1]."""
        lenses = np.asarray(lenses)
        return self._run(low.color[lenses[:, 0], lenses[:, 1]], low.scale)

    def _run(self, linear: Array, scale: int) -> Array:
        """(N, h, w, 3) scene-linear -> (N, s·h, s·w, 3) scene-linear."""
        if not len(linear):
            return np.zeros((0, linear.shape[1] * scale, linear.shape[2] * scale, 3), np.float32)
        if scale not in self._engines:
            self._engines[scale] = Engine(load(self.name, scale, self._weights), device=self._device)
        return self._engines[scale](self._finite(linear))

    def _finite(self, values: Array) -> Array:
        """Replace NaN and infinity by 0, with one note and one warning."""
        if np.isfinite(values).all():
            return values
        note = f"{self.name} met NaN or infinite values in its input and replaced them by 0"
        if note not in self.notes:
            self.notes.append(note)
            warnings.warn(note, stacklevel=4)
        return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)


class WholeEIAUpscaler(PhotographUpscaler):
    """The same over the whole EIA as one image: it shows the crosstalk that per-EI methods avoid.

    The latest rows are cached, because callers ask for few lenses at a time.
    """

    _cache: tuple[LowResEIA, int, Array] | None = None

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """Return the EIs of ``lenses`` (N, 2), cut from whole rows of lenses with enough neighbours above and below."""
        lenses = np.asarray(lenses)
        _, sx, h, w, _ = low.color.shape
        size = (h * low.scale, w * low.scale)
        result = np.empty((len(lenses), *size, 3), np.float32)
        for first in range(0, int(lenses[:, 0].max(initial=-1)) + 1, ROWS_AT_ONCE):
            chosen = (lenses[:, 0] >= first) & (lenses[:, 0] < first + ROWS_AT_ONCE)
            if chosen.any():
                rows = self._cached_rows(low, first).reshape(-1, size[0], sx, size[1], 3)
                result[chosen] = rows[lenses[chosen, 0] - first, :, lenses[chosen, 1]]
        return result

    def _cached_rows(self, low: LowResEIA, first: int) -> Array:
        if self._cache is None or self._cache[0] is not low or self._cache[1] != first:
            self._cache = (low, first, self._rows(low, first))
        return self._cache[2]

    def _rows(self, low: LowResEIA, first: int) -> Array:
        """Return rows of lenses from ``first`` on, (rows·h·s, sx·w·s, 3), as of the whole EIA."""
        sy, sx, h, w, _ = low.color.shape
        halo = math.ceil(RECEPTIVE_RADIUS / h)
        top, end = max(first - halo, 0), min(first + ROWS_AT_ONCE, sy)
        bottom = min(end + halo, sy)
        strip = low.color[top:bottom].transpose(0, 2, 1, 3, 4).reshape(1, (bottom - top) * h, sx * w, 3)
        start = (first - top) * h * low.scale
        return self._run(strip, low.scale)[0, start:start + (end - first) * h * low.scale]
