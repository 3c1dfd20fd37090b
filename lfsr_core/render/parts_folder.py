"""The hidden folder where parts of a long render are kept: where it is, and whether something is in it.

Apart from ``parts``, which reads images: the panel asks this, also where nothing that reads them is at hand.
"""

from __future__ import annotations

import re
from pathlib import Path

RANGE = re.compile(r"(\d+)-(\d+)-(\d+)$")  # end of a part's name: its first row or view, the next one, milliseconds


def parts_folder(target: Path) -> Path:
    """Where parts of a render into ``target`` are kept."""
    return target.with_name(f".{target.name}-parts")


def has_parts(folder: Path) -> bool:
    """True if a next render may find something in ``folder``."""
    return any(RANGE.search(path.stem) for path in folder.glob("*.exr"))


def kept_sentence(folder: Path) -> str:
    """What to tell somebody whose render ended early; empty where nothing was kept."""
    return (f"what is whole of it is kept: the same render again goes on from there; remove {folder} to be rid of it"
            if has_parts(folder) else "")
