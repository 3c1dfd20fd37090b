"""Seconds per stage."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from lfsr_core.reconstruct.clock import StageClock


def test_threads_share_the_clock():
    clock = StageClock()
    with clock.shared_by(2), ThreadPoolExecutor(2) as pool:
        def work(_):
            with clock("upscale"):
                time.sleep(0.2)
        list(pool.map(work, range(2)))
    assert clock.seconds["upscale"] == pytest.approx(0.2, abs=0.1)
