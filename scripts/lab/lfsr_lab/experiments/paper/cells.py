"""Measurements of one figure that are kept: a run that was stopped goes on where it was."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from lfsr_lab.experiments import cells
from lfsr_lab.experiments.engine.environment import load_average
from lfsr_lab.experiments.paper.settings import VERSION, Settings

Record = TypeVar("Record")
FOLDER = "cells"


class Cells(Generic[Record]):
    """The measurements of one figure, records of class ``kind`` in the folder OUTPUT/cells/FIGURE.

    ``load``: highest load average that was seen after any of them, None where the system tells none.
    """

    def __init__(self, settings: Settings, figure: str, kind: type[Record]) -> None:
        self.settings, self.kind, self.folder = settings, kind, settings.output / FOLDER / figure
        # None as a result is kept too: there were no weights.
        fields = [("result", kind | None), ("load", float | None)]
        self._kept = dataclasses.make_dataclass("Kept", fields, frozen=True)
        self.load: float | None = None

    def get(self, name: str, inputs: dict[str, Any], measure: Callable[[], Record | None]) -> Record | None:
        """What an earlier call of this name with the same ``inputs``, plain JSON, gave; else ``measure()``."""
        def measure_now() -> Any:
            print(f"{self.folder.name:7} {name}", file=sys.stderr, flush=True)
            result, load = measure(), load_average()
            return self._kept(result, None if load is None else round(load, 1))

        files = cells.Cells(self.folder, self._kept, key="inputs")
        kept = files.get(name, {"version": VERSION, **inputs}, measure_now)
        self.load = highest(self.load, kept.load)
        return kept.result


def highest(*loads: float | None) -> float | None:
    """The highest load average that is known."""
    return max((load for load in loads if load is not None), default=None)
