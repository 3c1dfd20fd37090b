"""Seconds per stage and peak memory of a run, for its report."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

try:
    import resource
except ImportError:  # Windows
    resource = None
STAGES = ("render", "load", "mask", "upscale", "assemble", "color", "write")


class StageClock:
    """``with clock("load"): ...`` adds the block's wall time to ``seconds["load"]``; a stage beyond STAGES joins them.

    Inside ``shared_by(n)`` blocks run in n threads at once and each counts for
    1/n, so that the stages still add up to the time that passed.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        self._threads, self._lock = 1, threading.Lock()

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
        """Blocks timed inside run in so many threads at once."""
        self._threads = threads
        try:
            yield
        finally:
            self._threads = 1


def peak_bytes() -> int | None:
    """Most memory this process has held so far, in bytes; None where the system does not report it (Windows)."""
    if resource is None:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
