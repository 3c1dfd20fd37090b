"""How many processor cores a process may use, and work on all of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

CORES = "LFSR_CORES"  # environment variable of processes that leave some cores to others
MOST_THREADS = 8  # more of them wait for memory
Item = TypeVar("Item")


def usable_cores() -> int:
    """Return the number in $LFSR_CORES, at most that of this machine's cores; without it, all of them."""
    every, asked = os.cpu_count() or 1, os.environ.get(CORES, "")
    return min(max(1, int(asked)), every) if asked.isdecimal() else every


def in_threads(work: Callable[[Item], object], items: Iterable[Item]) -> None:
    """Call ``work`` with each of ``items``, on every usable core but in at most MOST_THREADS threads."""
    with ThreadPoolExecutor(min(usable_cores(), MOST_THREADS)) as pool:
        list(pool.map(work, items))
