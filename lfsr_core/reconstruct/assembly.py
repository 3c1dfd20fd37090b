"""Steps of the second stage: one lens finished and placed in a pre-filled buffer, seconds per stage, threads."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.reconstruct.methods.interpolation import decode, encode, interpolated
from lfsr_core.reconstruct.upscaler import Upscaler

if sys.platform != "win32":
    import resource

STAGES = ("render", "load", "mask", "upscale", "assemble", "color", "write")


class StageClock:
    """``with clock("load"): ...`` adds the wall time of the block to ``seconds["load"]``.

    Inside ``shared_by(n)`` n threads run at once and each block counts for 1/n, so that the stages add up to the time
    that passed. ``rendered``: seconds per step of the render, from its frame.
    """

    def __init__(self, rendered: Mapping[str, float] | None = None) -> None:
        self.seconds: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        self.seconds["render"] = float(sum((rendered or {}).get(step, 0.0) for step in ("open", "render")))
        self._threads, self._lock = 1, threading.Lock()

    @property
    def rounded(self) -> dict[str, float]:
        """Seconds per stage, for a report."""
        return {stage: round(seconds, 4) for stage, seconds in self.seconds.items()}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        started = time.perf_counter()
        try:
            yield
        finally:
            passed = time.perf_counter() - started
            with self._lock:
                self.seconds[stage] = self.seconds.get(stage, 0.0) + passed / self._threads

    @contextmanager
    def shared_by(self, threads: int) -> Iterator[None]:
        """Divide the times of blocks by ``threads``, which run at once."""
        self._threads = threads
        try:
            yield
        finally:
            self._threads = 1


def peak_bytes() -> int | None:
    """Most memory that this process has held so far, in bytes; None on Windows, which does not report it."""
    if sys.platform != "win32":
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak if sys.platform == "darwin" else peak * 1024
    return None


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
    if flipped:
        count, *_, channels = images.shape
        # One item per pixel, which NumPy moves three times as fast as three channels.
        pixels = np.ascontiguousarray(images).reshape(count, -1, channels).view(f"V{channels * images.itemsize}")
        images = np.ascontiguousarray(pixels[:, ::-1]).view(images.dtype).reshape(images.shape)
    slots = to_elemental_images(buffer, grid)
    for (row, column), image in zip(lenses, images, strict=True):
        slots[row, column] = image


def finish_lenses(upscaler: Upscaler, low: LowResEIA, lenses: Array) -> Array:
    """EIs (N, h·s, w·s, 3), scene-linear, of ``lenses`` (N, 2): upscaled, before the world where there is one.

    Before a world the low-resolution EIA holds the subject alone, over black, and its opacity. The opacity is denoised
    and upscaled as colour is, in the same domain, so that no dark or bright seam is left between subject and world;
    the world itself is known at full resolution and without noise.
    """
    lenses = np.asarray(lenses)
    if low.world is None:
        return upscaler(low, lenses)
    assert low.opacity is not None, "Method.prepare has checked it"
    images = world_behind(upscaler, low, lenses)
    rows, columns = lenses.T
    some = low.opacity[rows, columns].any((1, 2, 3)) | low.rendered[rows, columns].any((1, 2, 3))
    if some.any():
        images[some] += upscaler(low, lenses[some])
    return images


def world_behind(upscaler: Upscaler, low: LowResEIA, lenses: Array) -> Array:
    """Light of the world (N, h·s, w·s, 3), scene-linear, that passes the subject in ``lenses`` (N, 2)."""
    assert low.world is not None and low.places is not None and low.opacity is not None, "Method.prepare has checked it"
    rows, columns = lenses.T
    images, opacity = low.world.elemental_images(low.places[rows, columns]), low.opacity[rows, columns]
    hiding = opacity.any((1, 2, 3))
    if hiding.any():
        images[hiding] *= 1 - np.clip(decode(interpolated(encode(opacity[hiding]), upscaler.kernel, low.factors)), 0, 1)
    return images


def blas_threads(most: int | None) -> contextlib.AbstractContextManager[Any]:
    """At most ``most`` BLAS threads inside the block, None for as many as there are.

    Workers that each started threads of their own would wait for one another. No effect without threadpoolctl:
    the add-on, which brings no packages, starts our process with one thread.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return contextlib.nullcontext()
    limits: contextlib.AbstractContextManager[Any] = threadpool_limits(most, "blas")
    return limits
