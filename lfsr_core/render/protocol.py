"""The progress protocol: ``LFSR {json}`` lines on standard output of every process that works for another.

The last line has the stage "done", "error" or "cancelled". While nothing new is to be said, ``repeated`` says again
what was said last, and for how long that holds.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

PROGRESS_PREFIX = "LFSR "
RENDERED_STAGE = "rendered"  # one of several jobs is whole in its folder
LAST_STAGES = ("done", "error", "cancelled")
EXIT_BAD_INPUT, EXIT_CANCELLED = 2, 130
# Environment variable that tells a process to end when its standard input does.
ENDS_WITH_INPUT = "LFSR_ENDS_WITH_INPUT"
SECONDS_OF_SILENCE = 1.0  # short, so that who prints a line every few seconds has something to print
LONGEST_WAIT = 1.0  # seconds for which the last record waits for another that is being written
_speaking = threading.Lock()
_last: tuple[dict[str, Any], float] | None = None  # record of a step under way, and when it was new


def emit(**record: Any) -> None:
    """Write one record; ``stage`` is always among its keys."""
    global _last
    if not record.get("warning"):
        _last = (record, time.monotonic()) if record["stage"] not in (*LAST_STAGES, RENDERED_STAGE) else None
    _write(record)


def emit_last(**record: Any) -> None:
    """Write the record of a process that ends now: nobody who speaks meanwhile is heard after it."""
    # Kept: others wait until the process ends. One who waits for a reader that has gone must not hold this up.
    _speaking.acquire(timeout=LONGEST_WAIT)
    _print(record)


def _write(record: dict[str, Any]) -> None:
    with _speaking:
        _print(record)


def _print(record: dict[str, Any]) -> None:
    # One write, because Cycles' thread speaks too.
    sys.stdout.write(PROGRESS_PREFIX + json.dumps(record) + "\n")
    sys.stdout.flush()


def emit_progress(stage: str, fraction: float, message: str) -> None:
    """A ``progress.Progress`` that writes records."""
    emit(stage=stage, fraction=round(fraction, 4), message=message)


def emit_warning(message: str) -> None:
    """Something the user should know that stops nothing."""
    emit(stage="render", fraction=0.0, message=message, warning=True)


@contextmanager
def repeated(silence: float = SECONDS_OF_SILENCE) -> Iterator[None]:
    """Inside the block the last progress is written again after ``silence`` seconds without another, and so on.

    Its message then ends with the seconds since it was new. Blender lets other threads run while it renders.
    """
    ended = threading.Event()
    thread = threading.Thread(target=_repeat, args=(ended, silence), daemon=True, name="lfsr-progress")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _repeat(ended: threading.Event, silence: float) -> None:
    while not ended.wait(silence):
        last = _last
        seconds = time.monotonic() - last[1] if last else 0.0
        if last and seconds >= silence:
            message = f"{last[0].get('message', '')}, for {seconds:.0f} s".removeprefix(", ")
            _write(last[0] | {"message": message})


def parse_progress(line: str) -> dict[str, Any] | None:
    """The record of one line, None for any other line of Blender's output.

    Blender cuts its own long messages, and the line end with them, so that a record may stand behind one.
    """
    start = line.find(PROGRESS_PREFIX + "{")
    if start < 0:
        return None
    try:
        record, _ = json.JSONDecoder().raw_decode(line, start + len(PROGRESS_PREFIX))
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) and "stage" in record else None
