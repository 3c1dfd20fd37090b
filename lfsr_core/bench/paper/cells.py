"""Single measurements that are kept: a run that was stopped goes on where it was."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json

FOLDER = "cells"
VERSION = 2  # another one where a measurement of the same inputs holds other numbers


class Cells:
    """Measurements of one figure, a JSON file each, in ``output``/cells/``figure``."""

    def __init__(self, output: Path, figure: str) -> None:
        self.folder = Path(output) / FOLDER / figure

    def __call__(self, name: str, inputs: dict[str, Any], measure: Callable[[], Any]) -> Any:
        """The result of ``measure()``, or the one kept from an earlier call of this name with the same ``inputs``.

        Both must be plain JSON. Nothing is kept of a measurement that fails.
        """
        path, inputs = self.folder / f"{name}.json", {"version": VERSION, **inputs}
        kept = _kept(path)
        if kept is not None and kept.get("inputs") == inputs:
            return kept["result"]
        print(f"{self.folder.name:7} {name}", file=sys.stderr, flush=True)
        result = measure()
        write_json(path, {"inputs": inputs, "result": result})
        return result


def _kept(path: Path) -> dict[str, Any] | None:
    """What the file holds, None if it is absent or damaged: it can be measured again."""
    try:
        kept = read_json(path, "a kept measurement")
    except LfsrError:
        return None
    return kept if isinstance(kept, dict) and "result" in kept else None
