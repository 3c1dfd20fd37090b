"""How many processor cores a process may use, work on all of them, and the memory that it takes."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

if sys.platform != "win32":
    import resource

CORES = "LFSR_CORES"  # environment variable of processes that leave some cores to others
MOST_THREADS = 8  # more of them wait for memory
MOST_MEMORY = 0.9  # of this computer's, that a child may take
SECONDS_BETWEEN = 0.5  # looks at it
Item = TypeVar("Item")


def usable_cores() -> int:
    """Return the number in $LFSR_CORES, at most that of this machine's cores; without it, all of them."""
    every, asked = os.cpu_count() or 1, os.environ.get(CORES, "")
    return min(max(1, int(asked)), every) if asked.isdecimal() else every


def peak_bytes() -> int | None:
    """Most memory that this process has held so far, in bytes; None on Windows, which does not report it."""
    if sys.platform != "win32":
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak if sys.platform == "darwin" else peak * 1024
    return None


def machine_bytes() -> float:
    """Memory of this computer, in bytes; infinite on Windows."""
    if sys.platform != "win32":
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return math.inf


def watch_memory(end: Callable[[str], object]) -> None:
    """Call ``end`` with a sentence, from a thread, once this process has held MOST_MEMORY of this computer's memory."""
    def watch() -> None:
        while (peak_bytes() or 0) <= MOST_MEMORY * machine_bytes():
            time.sleep(SECONDS_BETWEEN)
        end(f"this takes more than {MOST_MEMORY:.0%} of this computer's memory: make the scene or the display "
            "smaller, or use another computer")

    threading.Thread(target=watch, daemon=True, name="lfsr-memory").start()


def in_threads(work: Callable[[Item], object], items: Iterable[Item]) -> None:
    """Call ``work`` with each of ``items``, on every usable core but in at most MOST_THREADS threads."""
    with ThreadPoolExecutor(min(usable_cores(), MOST_THREADS)) as pool:
        list(pool.map(work, items))
