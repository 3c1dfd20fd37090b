"""How many processor cores a process may use, work on all of them, and the memory that it takes."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

if sys.platform != "win32":
    import resource

CORES = "LFSR_CORES"  # environment variable of processes that leave some cores to others
MOST_THREADS = 8  # more of them wait for memory
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


def in_threads(work: Callable[[Item], object], items: Iterable[Item]) -> None:
    """Call ``work`` with each of ``items``, on every usable core but in at most MOST_THREADS threads."""
    with ThreadPoolExecutor(min(usable_cores(), MOST_THREADS)) as pool:
        list(pool.map(work, items))
