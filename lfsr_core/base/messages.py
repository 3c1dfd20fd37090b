"""What a user is told: errors, progress, and notices, which stop nothing. This module imports quickly.

Codes and values cross boundaries. The part that shows a notice words it: the command line with ``commands.sentences``,
the panel with the add-on's own table.
"""

import dataclasses
import difflib
from collections.abc import Callable, Iterable
from typing import Any

MOST_CHARACTERS = 300  # of an error
MOST_LETTERS = 300  # of a text from elsewhere, such as a file's or a device's name


class LfsrError(ValueError):
    """Bad input or a missing prerequisite, reported in one sentence.

    The message names the value, what was expected and what to do; commands print it and exit with code 2. One longer
    than MOST_CHARACTERS loses its middle, because it begins with what is wrong and ends with what to do.
    """

    def __init__(self, message: str) -> None:
        message = " ".join(message.splitlines())
        if len(message) > MOST_CHARACTERS:
            message = f"{message[:MOST_CHARACTERS // 2]}…{message[1 - MOST_CHARACTERS // 2:]}"
        super().__init__(message)


def did_you_mean(value: str, choices: Iterable[str], cutoff: float = 0.6) -> str:
    """Return ``did you mean 'x'? `` for the choice most like ``value``, "" where none is like it.

    ``cutoff`` in [0, 1]: the least likeness, as in ``difflib``.
    """
    near = difflib.get_close_matches(value, list(choices), n=1, cutoff=cutoff)
    return f"did you mean {near[0]!r}? " if near else ""


@dataclasses.dataclass(frozen=True)
class Progress:
    """How far work has come."""

    stage: str  # what is done now, such as "render"
    fraction: float = 0.0  # of the stage, in [0, 1]
    detail: str = ""  # a file, a count or a place in the work, as it is shown beside the bar
    left: float | None = None  # seconds until all is done, None where they cannot be told
    cpu: float | None = None  # CPU seconds of the process that works, None where it does not tell them
    repeated: bool = False  # the last progress once more, because nothing has changed


@dataclasses.dataclass(frozen=True)
class Notice:
    """A fact about a render or an export, by its code such as "scale-chosen"; ``values`` fill its sentence."""

    code: str
    values: dict[str, Any] = dataclasses.field(default_factory=dict, hash=False)  # JSON-ready


Tell = Callable[[Progress | Notice], None]


def silent(_told: Progress | Notice) -> None:
    """Tell nobody."""


def cleaned(value: Any, most: int = MOST_LETTERS) -> Any:
    """Return a value to be shown: text from elsewhere without control characters, cut to ``most`` letters."""
    if isinstance(value, (list, tuple)):
        return [cleaned(item, most) for item in value]
    if not isinstance(value, str):
        return value
    text = " ".join("".join(letter if letter.isprintable() else " " for letter in value).split())
    return text if len(text) <= most else f"{text[:most - 1]}…"


def duration(seconds: float) -> str:
    """Return a time in the two largest of hours, minutes and seconds."""
    if (whole := round(seconds)) >= 3600:
        return f"{whole // 3600} h {whole % 3600 // 60} min"
    return f"{whole // 60} min {whole % 60} s" if whole >= 60 else f"{whole} s"
