"""Measurements stored in files at once, so that a run that was stopped continues where it was."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, write_json
from lfsr_core.base.records import from_data, to_data
from lfsr_lab.experiments.engine.environment import load_average
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
        """Return the file of one record."""
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
