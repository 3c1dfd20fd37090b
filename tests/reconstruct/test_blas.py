"""Threads of BLAS, with and without the package that limits them."""

from __future__ import annotations

import sys

import pytest

from lfsr_core.reconstruct.blas import blas_threads


def threads() -> set[int]:
    controller = pytest.importorskip("threadpoolctl").threadpool_info()
    return {pool["num_threads"] for pool in controller if pool["user_api"] == "blas"}


def test_threads_are_limited_inside_the_block():
    import numpy as np  # a BLAS library is loaded

    np.dot(np.ones((2, 2)), np.ones((2, 2)))
    before = threads()
    with blas_threads(1):
        assert threads() == {1}
    assert threads() == before


def test_the_package_is_not_needed(monkeypatch):
    monkeypatch.setitem(sys.modules, "threadpoolctl", None)
    with blas_threads(1):
        pass
