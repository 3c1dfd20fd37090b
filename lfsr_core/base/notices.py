"""What long work tells while it runs: progress, and notices that the user should know although they stop nothing.

Codes and values cross boundaries. Who shows a notice words it: the command line with ``commands.sentences``, the panel
with the add-on's own table.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any, TextIO

BAR_WIDTH = 30
SECONDS_BETWEEN_LINES = 4.0  # a render writes a record each second, so that a line comes every five at the latest
PROGRESS_VARIABLE, OPENJD = "LFSR_PROGRESS", "openjd"  # environment variable, set by our OpenJD template
MOST_LETTERS = 300  # of a text from elsewhere, such as a file's or a device's name
BOLD, RED = "1", "31"  # styles of terminals
_quiet = False


@dataclasses.dataclass(frozen=True)
class Progress:
    """How far work has come."""

    stage: str  # what is done now, such as "render"
    fraction: float = 0.0  # of the stage, in [0, 1]
    detail: str = ""  # a file, a count or a place in the work, as it is shown beside the bar
    left: float | None = None  # seconds until all is done, None where they cannot be told
    cpu: float | None = None  # CPU seconds of the process that works, None where it does not tell them
    repeated: bool = False  # said again because there is nothing new


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


class ProgressBar:
    """A ``Tell``: shows progress, and prints each notice once, as ``words`` says it."""

    def __init__(self, stream: TextIO | None = None, words: Callable[[Notice], str] = str) -> None:
        self._words, self._stream = words, stream or sys.stderr
        self._moving = self._stream.isatty()
        self._stage, self._shown_at, self._most = "", 0.0, 0.0
        self._told: list[Notice] = []

    def __call__(self, told: Progress | Notice) -> None:
        """Show progress, elsewhere than on a terminal only at a new stage, at the end, and every few seconds."""
        if _quiet:
            return
        if isinstance(told, Notice):
            if told not in self._told:
                self._told.append(told)
                self.note(self._words(told))
            return
        left = "" if told.left is None else f"{duration(told.left)} left"
        fraction, detail = min(max(told.fraction, 0.0), 1.0), ", ".join(filter(None, (cleaned(told.detail), left)))
        if self._moving:
            filled = round(BAR_WIDTH * fraction)
            start = "\n" if self._stage not in ("", told.stage) else "\r"
            bar = "█" * filled + "░" * (BAR_WIDTH - filled)
            self._stream.write(f"{start}{told.stage:10} {bar} {fraction:4.0%}  {detail[:60]}\x1b[K")
            self._stream.flush()
        elif told.stage != self._stage or fraction >= 1 or time.monotonic() - self._shown_at >= SECONDS_BETWEEN_LINES:
            if is_openjd():
                # A farm shows one number for the whole task: it must not fall where a new stage begins.
                self._most = max(self._most, fraction)
                tell_openjd(progress=f"{100 * self._most:.1f}", status=f"{told.stage} {detail}")
            else:
                print(f"{told.stage:10} {fraction:4.0%}  {detail}".rstrip(), file=self._stream, flush=True)
            self._shown_at = time.monotonic()
        self._stage = told.stage

    def note(self, message: str) -> None:
        """Print a line that stays."""
        self.close()
        print(f"note: {message}", file=self._stream, flush=True)

    def close(self) -> None:
        """End the moving line, so that the next print starts on its own line."""
        if self._moving and self._stage:
            print(file=self._stream)
        self._stage = ""


@contextlib.contextmanager
def be_quiet() -> Iterator[None]:
    """Show neither progress nor notices inside the block."""
    global _quiet
    _quiet = True
    try:
        yield
    finally:
        _quiet = False


def styled(text: str, style: str, stream: TextIO | None) -> str:
    """Return a text in BOLD or RED where ``stream`` is a terminal and NO_COLOR (no-color.org) is not set."""
    is_plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not (stream and stream.isatty())
    return text if is_plain else f"\x1b[{style}m{text}\x1b[0m"


def accept_all_letters() -> None:
    """Print "?" for letters that standard output or error lacks, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            with contextlib.suppress(OSError):  # a file that became a pipe
                stream.reconfigure(errors="replace")


def is_openjd() -> bool:
    """True inside a task of our OpenJD template."""
    return os.environ.get(PROGRESS_VARIABLE) == OPENJD


def tell_openjd(**messages: str) -> None:
    """Print messages of Open Job Description by their kind: ``progress`` (0 to 100), ``status``, ``fail``."""
    for kind, message in messages.items():
        print(f"openjd_{kind}: {' '.join(message.split())}", flush=True)


def duration(seconds: float) -> str:
    """Return a time in the two largest of hours, minutes and seconds."""
    whole = round(seconds)
    if whole >= 3600:
        return f"{whole // 3600} h {whole % 3600 // 60} min"
    return f"{whole // 60} min {whole % 60} s" if whole >= 60 else f"{whole} s"
