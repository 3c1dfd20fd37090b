"""Measurements of one figure that are kept: a run that was stopped goes on where it was."""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from lfsr_core.bench import cells
from lfsr_core.bench.environment import load_average

Record = TypeVar("Record")
FOLDER = "cells"
VERSION = 3  # another one where a measurement of the same inputs holds other numbers


class Cells:
    """The measurements of one figure, in the folder OUTPUT/cells/FIGURE.

    Attributes
    ----------
    folder: where the files are, and pictures beside them.
    load: highest load average that was seen after any of them, None where the system tells none.
    """

    def __init__(self, output: Path, figure: str) -> None:
        self.folder = output / FOLDER / figure
        self.load: float | None = None

    def get(self, kind: type[Record], name: str, inputs: dict[str, Any],
            measure: Callable[[], Record | None]) -> Record | None:
        """The record of an earlier call of this name with the same inputs, else what ``measure()`` gives.

        Parameters
        ----------
        kind: class of the record, a frozen dataclass.
        name: of the file.
        inputs: what the record depends on, plain JSON.
        measure: called where nothing is kept; None is kept too.
        """
        def measure_now() -> Any:
            print(f"{self.folder.name:7} {name}", file=sys.stderr, flush=True)
            result, load = measure(), load_average()
            return _kept(kind)(result, None if load is None else round(load, 1))

        files = cells.Cells(self.folder, _kept(kind), key="inputs")
        kept = files.get(name, {"version": VERSION, **inputs}, measure_now)
        self.load = max((load for load in (self.load, kept.load) if load is not None), default=None)
        return kept.result


@functools.cache
def _kept(kind: type) -> type:
    """Record of a measurement: its ``result``, and the load average after it."""
    return dataclasses.make_dataclass("Kept", [("result", kind | None), ("load", float | None)], frozen=True)
