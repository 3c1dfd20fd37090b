"""Cells, what a study measures: records stored in files at once, so that a run that was stopped goes on."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, write_json
from lfsr_core.base.records import from_data, to_data
from lfsr_core.frames.request import Request
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import load_average
from lfsr_lab.networks.methods import LabMethod

Record = TypeVar("Record")
Fingerprint = Mapping[str, Any]


@dataclasses.dataclass
class Records(Generic[Record]):
    """A folder of measured records, one JSON file each, with the fingerprint of what each depends on."""

    folder: Path  # where the files are
    kind: type[Record]  # class of the records, a frozen dataclass
    load: float | None = None  # highest load average after any measurement that was read or made, None if unknown

    def path(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def read(self, name: str, fingerprint: Fingerprint) -> Record | None:
        """Return the record ``name``, None if it is missing or damaged or has another fingerprint."""
        try:
            found = read_json(self.path(name), "a measurement")
            if not isinstance(found, dict) or found.get("fingerprint") != fingerprint:
                return None
            record = from_data(self.kind, found.get("record"), str(self.path(name)))
        except LfsrError:  # it can be measured again
            return None
        self._note(found.get("load"))
        return record

    def write(self, name: str, fingerprint: Fingerprint, record: Record) -> None:
        """Store a record with its fingerprint, which must be plain JSON."""
        load = load_average()
        self._note(load)
        write_json(self.path(name), {"fingerprint": dict(fingerprint), "load": load, "record": to_data(record)})

    def get(self, name: str, fingerprint: Fingerprint, measure: Callable[[], Record]) -> Record:
        """Return the record ``name``, measured and stored now unless it is there with this fingerprint."""
        found = self.read(name, fingerprint)
        if found is None:
            found = measure()
            self.write(name, fingerprint, found)
        return found

    def _note(self, load: float | None) -> None:
        self.load = max((each for each in (self.load, load) if each is not None), default=None)


def method_facts(name: str) -> dict[str, Any]:
    """Return what a measurement of a method depends on besides its render: weights and versions, plain JSON."""
    method = LabMethod.parse(name)
    return {"weights": method.weights_digest, "versions": method.name.versions}


@dataclasses.dataclass(frozen=True)
class StudySettings:
    """Settings of a study, which adds its own fields; they stand in its records."""

    @classmethod
    def given(cls, arguments: argparse.Namespace) -> dict[str, Any]:
        """Return the fields that a command line gives."""
        names = {field.name for field in dataclasses.fields(cls)}
        return {name: value for name, value in vars(arguments).items() if name in names and value is not None}


@dataclasses.dataclass(frozen=True)
class Cell(Generic[Record]):
    name: str  # of its record
    inputs: Fingerprint  # what it depends on, plain JSON: method, weights, versions, settings
    measure: Callable[[], Record]  # called when all renders are there
    jobs: Sequence[Request] = ()  # renders and references that it needs


def to_stderr(line: str) -> None:
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
