"""Can this Python run the second stage? ``python -m lfsr_core.tasks.probe`` answers in one line.

``python -m lfsr_core.tasks.probe denoiser`` says why Open Image Denoise is missing, with an empty line where it is not.
"""

from __future__ import annotations

import importlib
import platform
import sys

from lfsr_core.reconstruct.methods import oidn
from lfsr_core.version import __version__

OLDEST_PYTHON = (3, 11)
NEEDED = ("numpy", "OpenImageIO", "PyOpenColorIO", "lfsr_core.reconstruct.second_stage")


DENOISER = "denoiser"


def main(arguments: list[str]) -> int:
    """Print versions and denoiser, or what is missing; return the exit code."""
    if arguments == [DENOISER]:
        print(oidn.why_missing())
        return 0
    if sys.version_info < OLDEST_PYTHON:
        print(f"Python {platform.python_version()} is too old, {'.'.join(map(str, OLDEST_PYTHON))} or newer is needed")
        return 2
    try:
        for name in NEEDED:
            importlib.import_module(name)
    except (ImportError, OSError) as error:
        print(f"{type(error).__name__}: {error}")
        return 2
    found = [f"Python {platform.python_version()}", f"LFSR {__version__}"]
    print(", ".join([*found, "Open Image Denoise"] if not oidn.why_missing() else found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
