"""Can this Python run the second stage? ``python -m lfsr_core.tasks.probe`` says in one line what it found."""

from __future__ import annotations

import importlib
import platform
import sys

from lfsr_core import __version__
from lfsr_core.reconstruct.methods import denoise

OLDEST_PYTHON = (3, 11)
NEEDED = ("numpy", "OpenImageIO", "PyOpenColorIO")


def report() -> str:
    """Versions, engines and device in one line; ImportError or OSError where something needed is missing."""
    for name in NEEDED:
        importlib.import_module(name)
    importlib.import_module("lfsr_core.reconstruct.second_stage")
    found = [f"Python {platform.python_version()}", f"LFSR {__version__}"]
    found += ["Open Image Denoise"] if denoise.is_available() else []
    return ", ".join(found)


def _imports(name: str) -> bool:
    try:
        importlib.import_module(name)
    except (ImportError, OSError):
        return False
    return True


def main() -> int:
    """Print the report, or the one reason against; the exit code."""
    if sys.version_info < OLDEST_PYTHON:
        print(f"Python {platform.python_version()} is too old, {'.'.join(map(str, OLDEST_PYTHON))} or newer is needed")
        return 2
    try:
        print(report())
    except (ImportError, OSError) as error:
        print(f"{type(error).__name__}: {error}")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
