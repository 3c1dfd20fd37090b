"""Seconds per stage, and threads of BLAS with and without the package that limits them."""

import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lfsr_core.reconstruct.assembly import StageClock, blas_threads


def test_threads_share_the_clock():
    clock = StageClock()
    with clock.shared_by(2), ThreadPoolExecutor(2) as pool:
        def work(_):
            with clock("upscale"):
                time.sleep(0.2)
        list(pool.map(work, range(2)))
    assert clock.seconds["upscale"] == pytest.approx(0.2, abs=0.1)


def threads() -> set[int]:
    controller = pytest.importorskip("threadpoolctl").threadpool_info()
    return {pool["num_threads"] for pool in controller if pool["user_api"] == "blas"}


def test_threads_are_limited_inside_the_block():
    np.dot(np.ones((2, 2)), np.ones((2, 2)))  # a BLAS library is loaded
    before = threads()
    with blas_threads(1):
        assert threads() == {1}
    assert threads() == before


def test_the_package_is_not_needed(monkeypatch):
    monkeypatch.setitem(sys.modules, "threadpoolctl", None)
    with blas_threads(1):
        pass
