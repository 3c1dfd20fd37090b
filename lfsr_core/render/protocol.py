"""The progress protocol: ``LFSR {json}`` lines on standard output of every process that works for another.

The last line has the stage "done", "error" or "cancelled".
"""

from __future__ import annotations

import json
import sys
from typing import Any

PROGRESS_PREFIX = "LFSR "
RENDERED_STAGE = "rendered"  # one of several jobs is whole in its folder
LAST_STAGES = ("done", "error", "cancelled")
EXIT_BAD_INPUT, EXIT_CANCELLED = 2, 130
# Environment variable that tells a process to end when its standard input does.
ENDS_WITH_INPUT = "LFSR_ENDS_WITH_INPUT"


def emit(**record: Any) -> None:
    """Write one record; ``stage`` is always among its keys."""
    # One write, because Cycles' thread speaks too.
    sys.stdout.write(PROGRESS_PREFIX + json.dumps(record) + "\n")
    sys.stdout.flush()


def emit_progress(stage: str, fraction: float, message: str) -> None:
    """A ``progress.Progress`` that writes records."""
    emit(stage=stage, fraction=round(fraction, 4), message=message)


def emit_warning(message: str) -> None:
    """Something the user should know that stops nothing."""
    emit(stage="render", fraction=0.0, message=message, warning=True)


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
