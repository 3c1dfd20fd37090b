"""How many threads BLAS may start: workers that each started threads of their own would wait for one another."""

from __future__ import annotations

import contextlib
from contextlib import AbstractContextManager
from typing import Any


def blas_threads(most: int | None) -> AbstractContextManager[Any]:
    """At most ``most`` BLAS threads inside the block, None for as many as there are.

    No effect without threadpoolctl: the add-on, which brings no packages, starts our process with one thread.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return contextlib.nullcontext()
    limits: AbstractContextManager[Any] = threadpool_limits(most, "blas")
    return limits
