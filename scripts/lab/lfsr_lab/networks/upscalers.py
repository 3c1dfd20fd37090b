"""Comparators as upscalers: from the contract to a network trained on photographs and back.

Comparators were trained on photographs, so they see what photographs are:
sRGB-encoded RGB clipped to [0, 1]. Highlights above 1 are lost there; the
result is clipped and decoded to scene-linear again. (The light-field network has
its own upscaler and domain.)
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Protocol

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_lab.networks.engine import Engine, make_engine
from lfsr_lab.networks.networks import load

# Reach of the widest comparator (FSRCNN: 5×5, four 3×3 and 9×9 at stride s) in low-resolution pixels.
RECEPTIVE_RADIUS = 11
ROWS_AT_ONCE = 8


class _Upscaler(Protocol):
    """What can collect notes."""

    name: str
    notes: list[str]

    def __call__(self, low: LowResEIA, lenses: Array) -> Array: ...


class PhotographUpscaler:
    """A network trained on photographs, applied to each EI on its own.

    ``notes`` collects sentences for the report: replaced values, a smaller step,
    a fall-back to the CPU. ``thread_safe`` is False: the engine uses every core itself.
    """

    thread_safe = False

    def __init__(self, name: str, *, weights: str | Path | None = None, device: str = "auto",
                 step: int | None = None) -> None:
        self.name, self.notes = name, []
        self._weights, self._settings = weights, {"device": device, "step": step}
        self._engines: dict[int, Engine] = {}

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs of ``lenses`` (N, 2), (N, h·s, w·s, 3) float32 scene-linear in [0, 1]."""
        lenses = np.asarray(lenses)
        return self._run(low.color[lenses[:, 0], lenses[:, 1]], low.scale)

    def _run(self, linear: Array, scale: int) -> Array:
        """(N, h, w, 3) scene-linear -> (N, s·h, s·w, 3) scene-linear."""
        linear = replace_broken(linear, self)
        if not len(linear):
            return np.zeros((0, linear.shape[1] * scale, linear.shape[2] * scale, 3), np.float32)
        engine = self.engine(scale)
        result = engine(linear)
        self.notes += [note for note in engine.notes if note not in self.notes]
        return result

    def engine(self, scale: int) -> Engine:
        """The engine that runs the network at ``scale``, made once."""
        if scale not in self._engines:
            network = load(self.name, scale, self._weights)
            self._engines[scale] = make_engine(network, **self._settings)
        return self._engines[scale]


class WholeEIAUpscaler(PhotographUpscaler):
    """The same over the whole EIA as if it were one photograph: shows the crosstalk that per-EI methods avoid.

    The latest rows are kept, because callers ask for few lenses at a time.
    """

    _kept: tuple[LowResEIA, int, Array] | None = None

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs of ``lenses`` (N, 2), cut from whole rows of lenses with enough neighbours above and below."""
        lenses = np.asarray(lenses)
        _, sx, h, w, _ = low.color.shape
        size = (h * low.scale, w * low.scale)
        result = np.empty((len(lenses), *size, 3), np.float32)
        for first in range(0, int(lenses[:, 0].max(initial=-1)) + 1, ROWS_AT_ONCE):
            chosen = (lenses[:, 0] >= first) & (lenses[:, 0] < first + ROWS_AT_ONCE)
            if chosen.any():
                rows = self._kept_rows(low, first).reshape(-1, size[0], sx, size[1], 3)
                result[chosen] = rows[lenses[chosen, 0] - first, :, lenses[chosen, 1]]
        return result

    def _kept_rows(self, low: LowResEIA, first: int) -> Array:
        if self._kept is None or self._kept[0] is not low or self._kept[1] != first:
            self._kept = (low, first, self._rows(low, first))
        return self._kept[2]

    def _rows(self, low: LowResEIA, first: int) -> Array:
        """Some rows of lenses from ``first`` on, (rows·h·s, sx·w·s, 3), as the network gives them for the whole EIA."""
        sy, sx, h, w, _ = low.color.shape
        halo = math.ceil(RECEPTIVE_RADIUS / h)
        top, end = max(first - halo, 0), min(first + ROWS_AT_ONCE, sy)
        bottom = min(end + halo, sy)
        strip = low.color[top:bottom].transpose(0, 2, 1, 3, 4).reshape(1, (bottom - top) * h, sx * w, 3)
        start = (first - top) * h * low.scale
        return self._run(strip, low.scale)[0, start:start + (end - first) * h * low.scale]


def replace_broken(values: Array, owner: _Upscaler) -> Array:
    """Values with NaN and infinity replaced by 0, noted once."""
    broken = values.size - int(np.isfinite(values).sum())
    if not broken:
        return values
    note(owner, f"{owner.name} met NaN or infinite values in its input and replaced them by 0")
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)


def note(owner: _Upscaler, text: str) -> None:
    """Keep ``text`` for the report and warn, once."""
    if text not in owner.notes:
        owner.notes.append(text)
        warnings.warn(text, stacklevel=3)
