"""The finished EIA in strips of whole lens rows, several at once, so that little of it is in memory."""

from __future__ import annotations

import dataclasses
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lfsr_core.stages import Progress, StageClock
from lfsr_core.upscale import LowResEIA, Upscaler

MAX_WORKERS = 8


@dataclasses.dataclass(frozen=True)
class Plan:
    """Which lenses get what: ``mask`` (sy, sx) bool the ``upscaler``, ``fill`` the cheap ``filler``,
    the rest the scene-linear ``background``."""

    low: LowResEIA
    mask: np.ndarray
    fill: np.ndarray
    upscaler: Upscaler
    filler: Upscaler
    background: tuple[float, float, float]

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of the finished EIA."""
        sy, sx, h, w, _ = self.low.color.shape
        return sy * h * self.low.scale, sx * w * self.low.scale


def make_strips(plan: Plan, step: int | None, finish: Callable[[slice, np.ndarray], None], clock: StageClock,
                progress: Progress) -> None:
    """Call ``finish(rows, strip)`` for every strip, scene-linear (rows, W, 3) float32 in view order.

    Strips come in any order, from several threads. ``step``: elemental images per
    call of the upscaler, one row of lenses by default.
    """
    sy, sx = plan.mask.shape
    step = step or sx
    strips = [range(row, min(row + max(1, step // sx), sy)) for row in range(0, sy, max(1, step // sx))]
    workers = min(os.cpu_count() or 1, MAX_WORKERS, len(strips))
    turn = threading.Semaphore(workers if plan.upscaler.thread_safe else 1)
    height = plan.size[0] // sy

    def work(lens_rows: range) -> None:
        strip = _strip(plan, lens_rows, step, turn, clock)
        finish(slice(lens_rows.start * height, lens_rows.stop * height), strip)

    with ThreadPoolExecutor(workers) as pool, clock.shared_by(workers):
        for done, _ in enumerate(pool.map(work, strips), start=1):
            progress("upscale", done / len(strips), f"{done} of {len(strips)} strips")


def _strip(plan: Plan, lens_rows: range, step: int, turn: threading.Semaphore, clock: StageClock) -> np.ndarray:
    """One strip of the EIA, (rows, W, 3), pre-filled with the background."""
    sy, sx = plan.mask.shape
    py, px = plan.size[0] // sy, plan.size[1] // sx
    with clock("assemble"):
        strip = np.empty((len(lens_rows), py, sx, px, 3), np.float32)
        strip[:] = plan.background
    for wanted, upscaler in ((plan.mask, plan.upscaler), (plan.fill, plan.filler)):
        lenses = np.argwhere(wanted[lens_rows.start:lens_rows.stop])
        for start in range(0, len(lenses), step):
            chosen = lenses[start:start + step]
            with turn, clock("upscale"):
                elemental_images = upscaler(plan.low, chosen + [lens_rows.start, 0])
            with clock("assemble"):
                for (row, column), pixels in zip(chosen, elemental_images, strict=True):
                    strip[row, :, column] = pixels
    return strip.reshape(len(lens_rows) * py, sx * px, 3)
