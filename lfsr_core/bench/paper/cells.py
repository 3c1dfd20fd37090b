"""Single measurements that are kept: a run that was stopped goes on where it was."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json

FOLDER = "cells"
VERSION = 3  # another one where a measurement of the same inputs holds other numbers


class Cells:
    """Measurements of one figure, a JSON file each, in ``output``/cells/``figure``.

    ``load``: highest load average that was seen after any of them, None where the system tells none.
    """

    def __init__(self, output: Path, figure: str) -> None:
        self.folder = Path(output) / FOLDER / figure
        self.load: float | None = None

    def __call__(self, name: str, inputs: dict[str, Any], measure: Callable[[], Any]) -> Any:
        """The result of ``measure()``, or the one kept from an earlier call of this name with the same ``inputs``.

        Both must be plain JSON. Nothing is kept of a measurement that fails.
        """
        path, inputs = self.folder / f"{name}.json", {"version": VERSION, **inputs}
        kept = _kept(path)
        if kept is None or kept.get("inputs") != inputs:
            print(f"{self.folder.name:7} {name}", file=sys.stderr, flush=True)
            kept = {"inputs": inputs, "result": measure(), "load": _load()}
            write_json(path, kept)
        self.load = max((load for load in (self.load, kept.get("load")) if load is not None), default=None)
        return kept["result"]


def _load() -> float | None:
    return round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None


def _kept(path: Path) -> dict[str, Any] | None:
    """What the file holds, None if it is absent or damaged: it can be measured again."""
    try:
        kept = read_json(path, "a kept measurement")
    except LfsrError:
        return None
    return kept if isinstance(kept, dict) and "result" in kept else None
