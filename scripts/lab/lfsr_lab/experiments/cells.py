"""Results that are kept in files, so that a run that was stopped goes on where it was."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.records import from_data, to_data

Record = TypeVar("Record")
Fingerprint = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Cells(Generic[Record]):
    """A cache of measured records, one JSON file each: the record's fields and a fingerprint of what it depends on."""

    folder: Path  # where the files are
    kind: type[Record]  # the records' class, a frozen dataclass
    key: str | None = "fingerprint"  # entry that holds the fingerprint; None: its parts stand beside the fields

    def path(self, name: str) -> Path:
        """File of one record."""
        return self.folder / f"{name}.json"

    def read(self, name: str, fingerprint: Fingerprint) -> Record | None:
        """The record kept under ``name``; None if there is none, its fingerprint differs, or the file is damaged."""
        try:
            kept = read_json(self.path(name), "a kept measurement")
            parts = dict(kept) if isinstance(kept, dict) else {}
            found = parts.pop(self.key, None) if self.key else {part: parts.pop(part, None) for part in fingerprint}
            return from_data(self.kind, parts, str(self.path(name))) if found == fingerprint else None
        except LfsrError:  # it can be measured again
            return None

    def write(self, name: str, fingerprint: Fingerprint, record: Record) -> None:
        """Keep a record under ``name``."""
        mark = {self.key: fingerprint} if self.key else fingerprint
        write_json(self.path(name), {**mark, **to_data(record)})

    def get(self, name: str, fingerprint: Fingerprint, measure: Callable[[], Record]) -> Record:
        """The record kept under ``name``, else what ``measure()`` gives, which is then kept.

        ``fingerprint`` must be plain JSON. Nothing is kept of a measurement that fails.
        """
        found = self.read(name, fingerprint)
        if found is None:
            found = measure()
            self.write(name, fingerprint, found)
        return found


def digest(data: bytes) -> str:
    """Short hash of bytes, as a part of a fingerprint."""
    return hashlib.sha256(data).hexdigest()[:16]
