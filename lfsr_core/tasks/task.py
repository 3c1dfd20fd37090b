"""What the runner runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any


@dataclasses.dataclass(frozen=True)
class Task:
    """One task of the add-on."""

    # called with the entries of the task file; returns the result as JSON-ready data
    run: Callable[..., dict[str, Any]]
    # then a request to stop is an exception, so that they are stopped too; else it ends on the spot
    starts_processes: bool = False
