"""Texts as Blender shows them."""

from __future__ import annotations

import re

# Absolute paths, of which a panel shows the last name only.
PATH = re.compile(r"(?<![\w.:/\\])(?:[A-Za-z]:)?[\\/](?:[^\\/\s'\"]+[\\/])+([^\\/\s'\",:;)]+)")
ASIDE = re.compile(r" \(--[a-z-]+\)")
OPTION = re.compile(r"(?:(?:give|with) )?--[a-z][a-z-]*")
# What a panel has instead of an option of the command line.
SETTINGS = {"with --light": "under Quality", "give --overwrite": "turn on Overwrite", "--camera": "the active camera",
            "--subject": "the subject", "--linear-exr": "Linear EXR", "--world-visible": "the world"}


def for_panel(text: str) -> str:
    """Return a message as the panel shows it: without paths and options of the command line, and with a capital."""
    text = ASIDE.sub("", PATH.sub(r"\1", text))
    return capitalized(OPTION.sub(_setting, text))


def _setting(match: re.Match[str]) -> str:
    option = match[0]
    words, _, name = option.rpartition("--")
    return SETTINGS.get(option) or words + SETTINGS.get(f"--{name}", name.replace("-", " ").title())


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
