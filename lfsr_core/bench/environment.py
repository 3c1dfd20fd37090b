"""Runs the stability suite: scenes, references, renders and one small JSON file per cell.

A *cell* is one method at one value of one dial. What is complete in the bench
folder is not made again, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import sys
from pathlib import Path
from typing import Any


def environment() -> dict[str, Any]:
    """What the figures depend on besides the code."""
    packages = [name for name in ("bpy", "numpy", "pyoidn", "openimageio", "torch") if importlib.util.find_spec(
        {"openimageio": "OpenImageIO"}.get(name, name))]
    return {"cores": os.cpu_count(), "machine": platform.machine(), "python": platform.python_version(),
            "executable": Path(sys.executable).name, "versions": {name: _version(name) for name in packages}}


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"
