"""The progress protocol: ``LFSR {json}`` lines on standard output of every process that works for another.

The last line has the stage "done", "error" or "cancelled".
"""

from __future__ import annotations

import json
import sys
from typing import Any

PROGRESS_PREFIX = "LFSR "
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


def parse_progress(line: str) -> dict[str, Any] | None:
    """The record of one line, None for any other line of Blender's output."""
    if not line.startswith(PROGRESS_PREFIX):
        return None
    try:
        record = json.loads(line[len(PROGRESS_PREFIX):])
    except json.JSONDecodeError:
        return None
    return record if isinstance(record, dict) and "stage" in record else None
