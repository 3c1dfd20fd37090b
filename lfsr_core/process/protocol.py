"""The progress protocol: ``LFSR {json}`` lines on the standard output of every process that works for another.

The last line has the stage "done", "error" or "cancelled". ``repeated`` writes the last progress again while there is
none that is new.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from lfsr_core.base.notices import Notice, Progress

PROGRESS_PREFIX = "LFSR "
RENDERED_STAGE = "rendered"  # one of several jobs is complete in its folder
LAST_STAGES = ("done", "error", "cancelled")
EXIT_BAD_INPUT, EXIT_CANCELLED = 2, 130
# Environment variable that tells a process to end when its standard input does.
ENDS_WITH_INPUT = "LFSR_ENDS_WITH_INPUT"
# Environment variable that names Blender's folder to a process outside it, which finds libraries there.
BLENDER_FOLDER = "LFSR_BLENDER_FOLDER"
SECONDS_OF_SILENCE = 1.0  # short, so that a program that prints a line every few seconds has something to print
LONGEST_WAIT = 1.0  # seconds that the last record waits for another that is being written
_speaking = threading.Lock()
_last: tuple[dict[str, Any], float] | None = None  # record of a step under way, and when it was new


def emit(**record: Any) -> None:
    """Write one record; ``stage`` is always among its keys."""
    global _last
    if "notice" not in record:
        _last = (record, time.monotonic()) if record["stage"] not in (*LAST_STAGES, RENDERED_STAGE) else None
    with _speaking:
        _write(record)


def emit_last(**record: Any) -> None:
    """Write the record of a process that ends now; no other thread can write one after it."""
    # The lock is not released: other threads wait until the process ends. One that waits for a reader that has gone
    # must not hold this up.
    _speaking.acquire(timeout=LONGEST_WAIT)
    _write(record)


def _cpu() -> float:
    return round(time.process_time(), 2)


def emit_told(told: Progress | Notice) -> None:
    """Write progress or a notice as a record, which ``told_of`` reads; a ``Tell``."""
    if isinstance(told, Notice):
        emit(stage="notice", notice=told.code, values=told.values)
    else:
        emit(stage=told.stage, fraction=round(told.fraction, 4), message=told.detail,
             left=told.left if told.left is None else round(told.left, 1),
             cpu=_cpu() if told.cpu is None else told.cpu, repeated=told.repeated)


def told_of(record: dict[str, Any]) -> Progress | Notice | None:
    """Return the progress or the notice in a record, None where it is another."""
    if "notice" in record:
        return Notice(record["notice"], record["values"])
    if "fraction" not in record:
        return None
    return Progress(record["stage"], min(1.0, float(record["fraction"])), str(record.get("message", "")),
                    record.get("left"), record.get("cpu"), bool(record.get("repeated")))


@contextmanager
def repeated(silence: float = SECONDS_OF_SILENCE) -> Iterator[None]:
    """Inside the block, write the last progress again after each ``silence`` seconds without another.

    Its message then ends with the seconds since it was new. Blender lets other threads run while it renders.
    """
    ended = threading.Event()

    def repeat() -> None:
        while not ended.wait(silence):
            last = _last
            seconds = time.monotonic() - last[1] if last else 0.0
            if last and seconds >= silence:
                message = f"{last[0].get('message', '')}, for {seconds:.0f} s".removeprefix(", ")
                with _speaking:
                    _write(last[0] | {"message": message, "cpu": _cpu(), "repeated": True})

    thread = threading.Thread(target=repeat, daemon=True, name="lfsr-progress")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def parse_progress(line: str) -> dict[str, Any] | None:
    """Return the record in a line, None for any other line of Blender's output.

    A record may follow other text on its line: Blender cuts its own long messages, and the line end with them.
    """
    start = line.find(PROGRESS_PREFIX + "{")
    if start < 0:
        return None
    try:
        record, _ = json.JSONDecoder().raw_decode(line, start + len(PROGRESS_PREFIX))
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) and "stage" in record else None


def _write(record: dict[str, Any]) -> None:
    # In one write, because Cycles' thread writes too.
    sys.stdout.write(PROGRESS_PREFIX + json.dumps(record) + "\n")
    sys.stdout.flush()
