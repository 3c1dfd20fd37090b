"""How many processor cores a process may use."""

from __future__ import annotations

import os

CORES = "LFSR_CORES"  # environment variable of processes that leave some cores to others


def usable_cores() -> int:
    """Return the number in $LFSR_CORES, at most that of this machine's cores; without it, all of them."""
    every, asked = os.cpu_count() or 1, os.environ.get(CORES, "")
    return min(max(1, int(asked)), every) if asked.isdecimal() else every
