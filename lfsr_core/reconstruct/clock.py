"""Seconds per stage and peak memory of a run, for its report."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

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
