"""Texts as Blender shows them."""

from __future__ import annotations

import re

# Absolute paths, of which a panel shows the last name only.
PATH = re.compile(r"(?<![\w.:/\\])(?:[A-Za-z]:)?[\\/](?:[^\\/\s'\"]+[\\/])+([^\\/\s'\",:;)]+)")


def for_panel(text: str) -> str:
    """Return a message as the panel shows it: without the folders of its paths, and with a capital."""
    return capitalized(PATH.sub(r"\1", text))


def capitalized(text: str) -> str:
    """Return ``text`` with a capital, unless it begins with a name such as that of a file."""
    return text[:1].upper() + text[1:] if text.split(" ", maxsplit=1)[0].isalpha() else text


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, as in "1 problem" or "2 problems"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def clock(seconds: float) -> str:
    """Return a time as a clock shows it, as in "0:42" or "1:02:03"."""
    minutes, whole = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{whole:02d}" if minutes >= 60 else f"{minutes}:{whole:02d}"
