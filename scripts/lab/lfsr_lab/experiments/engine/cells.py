"""Cells: what a study measures, one figure or row of figures at a time."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Generic, TypeVar

from lfsr_core.frames.request import Request
from lfsr_lab.experiments.engine.records import Fingerprint, Records
from lfsr_lab.experiments.engine.renders import Store

Record = TypeVar("Record")


@dataclasses.dataclass(frozen=True)
class Cell(Generic[Record]):
    """One measurement."""

    name: str  # of its record
    inputs: Fingerprint  # what it depends on, plain JSON: method, weights, versions, settings
    measure: Callable[[], Record]  # called when all renders are there
    jobs: Sequence[Request] = ()  # renders and references that it needs


def to_stderr(line: str) -> None:
    """Print a line of progress."""
    print(line, file=sys.stderr, flush=True)


def measured(cells: Iterable[Cell[Record]], records: Records[Record], store: Store) -> Iterator[Record]:
    """Yield the record of every cell; what is missing is rendered and measured now, and stored at once.

    Parameters
    ----------
    cells : what to measure, in order
    records : where records are stored
    store : where renders are
    """
    for cell in cells:
        found = records.read(cell.name, cell.inputs)
        if found is None:
            store.render_all(cell.jobs)
            to_stderr(f"measuring {records.folder / cell.name}")
            found = cell.measure()
            records.write(cell.name, cell.inputs, found)
        yield found
