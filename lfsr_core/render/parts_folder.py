"""The hidden folder for the finished parts of a long render.

The panel asks for it, also where the modules that read images cannot be imported; so it is apart from ``parts``.
"""

from __future__ import annotations

import re
from pathlib import Path

RANGE = re.compile(r"(\d+)-(\d+)-(\d+)$")  # end of a part's name: its first row or view, the next one, milliseconds


def parts_folder(target: Path) -> Path:
    """Return the folder for the parts of a render into ``target``."""
    return target.with_name(f".{target.name}-parts")


def has_parts(folder: Path) -> bool:
    """True if the next render may continue from a part in ``folder``."""
    return any(RANGE.search(path.stem) for path in folder.glob("*.exr"))


def parts_sentence(folder: Path) -> str:
    """Return what to tell a user whose render ended early, "" where ``folder`` has no parts."""
    return f"Render again to continue, or delete {folder} to start over" if has_parts(folder) else ""
