"""The second stage for the add-on: one task in a process of its own.

    python -m lfsr_core.tasks.runner TASK.json

Progress and the result are ``LFSR {json}`` lines on standard output, as the
render stage writes them; the last one has the stage "done" or "error". The
process ends when its standard input does, so that none outlives Blender.
"""

from __future__ import annotations

import os
import signal
import sys
import threading

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.render.protocol import EXIT_BAD_INPUT, EXIT_CANCELLED, emit
from lfsr_core.tasks.frame_tasks import TASKS


def main(arguments: list[str]) -> int:
    """Run the task file named in ``arguments``; the process's exit code."""
    signal.signal(signal.SIGTERM, _stop)
    threading.Thread(target=_end_with_parent, daemon=True, name="lfsr-parent").start()
    try:
        task = read_json(arguments[0], "a task of the add-on")
        result = TASKS[task.pop("task")](**task)
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    emit(stage="done", **result)
    return 0


def _stop(_signal: int, _stack: object) -> None:
    # What is half-written lies in temporary files, which the add-on's staging folder takes with it.
    os._exit(EXIT_CANCELLED)


def _end_with_parent() -> None:
    # Not sys.stdin: a thread that holds its lock aborts Python at exit.
    while os.read(0, 1):
        pass
    os._exit(EXIT_CANCELLED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
