"""Methods of the second stage as the panel lists them."""

from __future__ import annotations

import zlib

from lfsr_core.reconstruct.methods import MENU, MORE

DIRECT = "Direct Subpixel Rendering"

def title(name: str) -> str:
    """Title of a method in the menu; of one that is not in it, its name."""
    return (MENU | MORE).get(name, (name, ""))[0]


def method_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items; each has a number of its own, so that new methods do not change saved scenes."""
    return [*_items(MENU), ("", "More", "", "NONE", 0), *_items(MORE)]


def _items(methods: dict[str, tuple[str, str]]) -> list[tuple[str, str, str, str, int]]:
    return [(name, title, text, "NONE", zlib.crc32(name.encode()) & 0x7FFFFFFF)
            for name, (title, text) in methods.items()]
