"""What a document was made of: every input with its digest, records, commands, machines and seeds."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json
from lfsr_lab.experiments.document.studies import Table

Digests = dict[str, str]  # SHA-256 by the file's path below the asset's folder
BESIDE = (".gltf", ".obj")  # scenes whose other files lie beside them


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, as the program sha256sum prints it."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digests(scene: Path) -> Digests:
    """Return the digest of an asset's file, and of all files in its folder where it is not of one file."""
    folder = scene.parent
    files = sorted(path for path in folder.rglob("*") if path.is_file()) if scene.suffix in BESIDE else [scene]
    return {path.relative_to(folder).as_posix(): sha256(path) for path in files}


def inputs(table: Table, known: Mapping[str, Digests], before: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return name, licence, source and digests of every asset that was read, now or by an earlier manifest."""
    files = {entry["name"]: entry["files"] for entry in before} | dict(known)
    return [{"name": asset.name, "licence": asset.licence, "source": asset.source, "files": files[asset.name]}
            for asset in table.asset if asset.name in files]


def record_facts(path: Path, command: str) -> dict[str, Any]:
    """Return digest, command, machine and seeds of a record."""
    try:
        data = read_json(path, "a record")
    except LfsrError:  # a page, or damaged: its section says so
        data = None
    machine = (data.get("environment") if isinstance(data, dict) else None) or {}
    return {"file": path.name, "command": command, "sha256": sha256(path), "machine": machine_text(machine),
            "seeds": sorted(set(_seeds(data)))}


def machine_text(machine: Mapping[str, Any]) -> str:
    """Return processor, cores and versions in words; records of older releases name fewer."""
    versions = ", ".join(f"{name} {number}" for name, number in machine.get("versions", {}).items())
    parts = [f"{machine['cores']} cores" if "cores" in machine else "", machine.get("cpu") or machine.get("machine"),
             machine.get("system"), versions]
    return ", ".join(part for part in parts if part)


def commit() -> str | None:
    """Return the commit of the clone that this is, None where it is none."""
    try:
        found = subprocess.run(["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"], check=True,
                               capture_output=True, text=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip()


def _seeds(data: Any) -> Iterator[int]:
    """Yield every number called seed in a record, and those below a number of seeds."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        if key == "seed" and isinstance(value, int):
            yield value
        elif key == "seeds" and isinstance(value, int):
            yield from range(value)
        elif isinstance(value, (dict, list)):
            yield from _seeds(value)
