"""Assemble the finished EIA in a pre-filled buffer, lens by lens and on every core.

Only a few elemental images at a time exist in linear light: an 8K image of floats would take 400 MB, and longer to
move than to make.
"""

from __future__ import annotations

import contextlib
import dataclasses
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import usable_cores
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Progress, Tell
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.reconstruct.blas import blas_threads
from lfsr_core.reconstruct.clock import StageClock
from lfsr_core.reconstruct.contract import Upscaler
from lfsr_core.reconstruct.world import finish_lenses

MAX_WORKERS = 8
STEP_IN_CACHE = 24
Put = Callable[[Array, Array], None]


@dataclasses.dataclass(frozen=True)
class Assembly:
    """The lenses of a frame and what finishes them."""

    low: LowResEIA  # the low-resolution EIA after every prefilter
    mask: Array  # (sy, sx) bool, lenses for the upscaler
    fill: Array  # (sy, sx) bool, lenses for the filler
    upscaler: Upscaler  # of the method
    filler: Upscaler  # a cheap one

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of the finished EIA."""
        (sy, sx), (py, px) = self.low.color.shape[:2], self.low.finished_views
        return sy * py, sx * px

    def parts(self, step: int | None) -> list[tuple[Upscaler, Array]]:
        """Upscaler and lenses (n, 2), n <= ``step``, of every call, in reading order.

        By default as many lenses as stay in a core's cache, or one row of the display for an upscaler that uses
        every core itself. LfsrError for a step < 1.
        """
        if step is not None and step < 1:
            raise LfsrError(f"step is {step}, but it must be 1 or more elemental images per call")
        parts = []
        for wanted, upscaler in ((self.mask, self.upscaler), (self.fill, self.filler)):
            size = step or (STEP_IN_CACHE if upscaler.thread_safe else self.mask.shape[1])
            lenses = np.argwhere(wanted)
            parts += [(upscaler, lenses[start:start + size]) for start in range(0, len(lenses), size)]
        return parts


def upscale_all(assembly: Assembly, step: int | None, put: Put, clock: StageClock, tell: Tell) -> None:
    """Finish every lens of the assembly, in several threads and in any order.

    Upscalers that are not thread-safe run one call at a time. ``step``: see ``Assembly.parts``. ``put``: called
    with lenses (n, 2) and their elemental images (n, py, px, 3), scene-linear.
    """
    parts = assembly.parts(step)
    workers = max(1, min(usable_cores(), MAX_WORKERS, len(parts)))
    one_at_a_time = threading.Lock()

    def work(part: tuple[Upscaler, Array]) -> None:
        upscaler, lenses = part
        with contextlib.nullcontext() if upscaler.thread_safe else one_at_a_time, clock("upscale"):
            images = finish_lenses(upscaler, assembly.low, lenses)
        put(lenses, images)

    most = 1 if assembly.upscaler.thread_safe else None
    with blas_threads(most), ThreadPoolExecutor(workers) as pool, clock.shared_by(workers):
        for done, _ in enumerate(pool.map(work, parts), start=1):
            tell(Progress("upscale", done / len(parts), f"{done} of {len(parts)} steps"))


def filled(size: tuple[int, int], color: Array) -> Array:
    """Buffer (H, W, C) filled with one ``color`` (C,), of its type."""
    buffer = np.empty((*size, len(color)), color.dtype)
    # Row by row, as broadcasting one pixel would copy byte by byte.
    buffer[:] = np.tile(color, (size[1], 1))
    return buffer


def place(buffer: Array, grid: tuple[int, int], lenses: Array, images: Array, flipped: bool) -> None:
    """Copy EIs ``images`` (n, py, px, C) of ``lenses`` (n, 2) into an EIA (H, W, C) with a ``grid`` (sx, sy) of lenses.

    ``flipped``: reverse the pixels of each EI in both axes, the order of a panel behind lenses.
    """
    slots = to_elemental_images(buffer, grid)
    for (row, column), image in zip(lenses, _reversed(images) if flipped else images, strict=True):
        slots[row, column] = image


def _reversed(images: Array) -> Array:
    """EIs (n, py, px, C) with their pixels in reverse order in both axes."""
    count, *_, channels = images.shape
    # One item per pixel, which NumPy moves three times as fast as three channels.
    pixels = np.ascontiguousarray(images).reshape(count, -1, channels).view(f"V{channels * images.itemsize}")
    return np.ascontiguousarray(pixels[:, ::-1]).view(images.dtype).reshape(images.shape)
