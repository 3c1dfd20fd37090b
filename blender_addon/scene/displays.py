"""Displays as the panel lists them."""

from __future__ import annotations

import re
import zlib

from lfsr_core.optics.display import builtin_names, load_display

PROFILE_FILE = "FILE"
DEFAULT_DISPLAY = "first-look"  # a new file's: its images take seconds on two cores
DIRECT = "Direct Subpixel Rendering"  # of a display with a lens sheet


def profile_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items of the built-in displays by title, then of a profile in a file.

    Each has a number of its own, so that new displays do not change saved scenes.
    """
    displays = [load_display(name) for name in builtin_names()]
    items = [(display.name, display.title or display.name, display.description.rstrip("."), "DESKTOP",
              zlib.crc32(display.name.encode()) & 0x7FFFFFFF) for display in displays]
    return [*sorted(items, key=lambda item: _natural(item[1])),
            (PROFILE_FILE, "From File…", "Display profile in a .toml file", "FILE", 0)]


def _natural(title: str) -> list[tuple[float, str]]:
    """Key that sorts numbers by their size: 5″ stands before 14″."""
    parts = re.split(r"(\d+(?:\.\d+)?)", title.casefold())
    return [(float(part), "") if number % 2 else (-1.0, part) for number, part in enumerate(parts)]
