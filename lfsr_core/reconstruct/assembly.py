"""The finished EIA, lens by lens into a pre-filled buffer, on every core.

Only a few elemental images at a time exist in linear light: an 8K image of
floats would take 400 MB and more time to move than to make.
"""

from __future__ import annotations

import dataclasses
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from threadpoolctl import threadpool_limits

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.progress import Progress
from lfsr_core.reconstruct.clock import StageClock
from lfsr_core.reconstruct.contract import Upscaler

MAX_WORKERS = 8
STEP_IN_CACHE = 24
Finish = Callable[[Array, Array], None]


@dataclasses.dataclass(frozen=True)
class Assembly:
    """Which lenses of a frame are finished by what."""

    low: LowResEIA  # the low-resolution EIA after every prefilter
    mask: Array  # (sy, sx) bool, lenses for the upscaler
    fill: Array  # (sy, sx) bool, lenses for the filler
    upscaler: Upscaler  # the method's
    filler: Upscaler  # a cheap one

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of the finished EIA."""
        (sy, sx), (py, px) = self.low.color.shape[:2], self.low.finished_views
        return sy * py, sx * px

    def parts(self, step: int | None) -> list[tuple[Upscaler, Array]]:
        """Upscaler and lenses (n, 2) of every call, n <= ``step``, in reading order.

        By default as many lenses as stay in a core's cache, or for an upscaler that
        uses every core itself one row of the display. LfsrError for a step < 1.
        """
        if step is not None and step < 1:
            raise LfsrError(f"step is {step}, but it must be 1 or more elemental images per call")
        parts = []
        for wanted, upscaler in ((self.mask, self.upscaler), (self.fill, self.filler)):
            size = step or (STEP_IN_CACHE if upscaler.thread_safe else self.mask.shape[1])
            lenses = np.argwhere(wanted)
            parts += [(upscaler, lenses[start:start + size]) for start in range(0, len(lenses), size)]
        return parts


def upscale_all(assembly: Assembly, step: int | None, finish: Finish, clock: StageClock, progress: Progress) -> None:
    """Finish every lens of the assembly, in several threads and in any order.

    Upscalers that are not thread-safe run one call at a time.

    Parameters
    ----------
    assembly : which lenses get what
    step : elemental images per call, None for as many as suit the upscaler
    finish : called with lenses (n, 2) and their elemental images (n, py, px, 3), scene-linear
    clock : times the stage "upscale"
    progress : called after every part
    """
    parts = assembly.parts(step)
    workers = max(1, min(os.cpu_count() or 1, MAX_WORKERS, len(parts)))
    one_at_a_time = threading.Lock()

    def work(part: tuple[Upscaler, Array]) -> None:
        upscaler, lenses = part
        if upscaler.thread_safe:
            with clock("upscale"):
                images = upscaler(assembly.low, lenses)
        else:
            with one_at_a_time, clock("upscale"):
                images = upscaler(assembly.low, lenses)
        finish(lenses, images)

    # Workers that each start BLAS threads of their own wait for one another.
    blas_threads = 1 if assembly.upscaler.thread_safe else None
    with threadpool_limits(blas_threads, "blas"), ThreadPoolExecutor(workers) as pool, clock.shared_by(workers):
        for done, _ in enumerate(pool.map(work, parts), start=1):
            progress("upscale", done / len(parts), f"{done} of {len(parts)} steps")


def filled(size: tuple[int, int], color: Array) -> Array:
    """Buffer (H, W, C) of one ``color`` (C,) and its type."""
    buffer = np.empty((*size, len(color)), color.dtype)
    # Whole rows at once; broadcasting one pixel would copy byte by byte.
    buffer[:] = np.tile(color, (size[1], 1))
    return buffer


def place(buffer: Array, grid: tuple[int, int], lenses: Array, images: Array, flipped: bool) -> None:
    """Put elemental images where they belong.

    Parameters
    ----------
    buffer : the EIA (H, W, C), changed
    grid : its lenses (sx, sy)
    lenses : (n, 2) rows and columns
    images : of those lenses, (n, py, px, C)
    flipped : reverses the pixels inside each in both axes, the order of a panel behind lenses
    """
    slots = to_elemental_images(buffer, grid)
    for (row, column), image in zip(lenses, _reversed(images) if flipped else images, strict=True):
        slots[row, column] = image


def _reversed(images: Array) -> Array:
    """EIs (n, py, px, C) with their pixels in reverse order, in both axes."""
    count, *_, channels = images.shape
    # As one item per pixel, which NumPy moves three times as fast as three channels.
    pixels = np.ascontiguousarray(images).reshape(count, -1, channels).view(f"V{channels * images.itemsize}")
    return np.ascontiguousarray(pixels[:, ::-1]).view(images.dtype).reshape(images.shape)
