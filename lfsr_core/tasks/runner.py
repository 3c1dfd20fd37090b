"""Run one task of the add-on in a process of its own.

    python -m lfsr_core.tasks.runner TASK.json

Progress and the result are ``LFSR {json}`` lines on standard output; the last one has the stage "done" or "error".
The process ends when its standard input does, so that it does not outlive Blender.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, system_errors
from lfsr_core.process.child import Child
from lfsr_core.process.protocol import EXIT_BAD_INPUT, EXIT_CANCELLED, emit, repeated
from lfsr_core.tasks import tasks

SECONDS_TO_STOP = 1.0  # less than the add-on waits for the task itself
# A task takes the entries of its file and returns JSON-ready data.
Task = Callable[..., dict[str, Any]]
STARTING: dict[str, Task] = {task.__name__: task for task in (
    tasks.make, tasks.reference, tasks.estimate, tasks.plan, tasks.export, tasks.show)}  # start processes
TASKS: dict[str, Task] = STARTING | {task.__name__: task for task in (tasks.finish, tasks.decode, tasks.view)}


def main(arguments: list[str]) -> int:
    """Run the task file named in ``arguments``; return the exit code."""
    try:
        data = read_json(arguments[0], "a task of the add-on")
        name = data.pop("task")
        _end_on_request(unwinds=name in STARTING)
        with system_errors(), repeated():
            result = TASKS[name](**data)
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        return EXIT_CANCELLED
    emit(stage="done", **result)
    return 0


def _end_on_request(unwinds: bool) -> None:
    """End at a signal, and at the end of standard input, which comes with the end of Blender.

    ``unwinds``: by an exception, so that processes of the task are stopped too; otherwise at once.
    """
    def end_with_parent() -> None:
        # Not sys.stdin: a thread that holds its lock aborts Python at exit.
        while os.read(0, 1):
            pass
        if unwinds:
            if sys.platform == "win32":
                _thread.interrupt_main(signal.SIGTERM)
            else:  # wakes the main thread where it waits for another
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
            Child.stop_all(SECONDS_TO_STOP)  # the main thread waits for what they write
        else:
            _leave()

    signal.signal(signal.SIGTERM, _unwind if unwinds else _leave)
    threading.Thread(target=end_with_parent, daemon=True, name="lfsr-parent").start()


def _unwind(*_: object) -> None:
    raise KeyboardInterrupt


def _leave(*_: object) -> None:
    # Temporary files lie in the add-on's staging folder, which is removed.
    os._exit(EXIT_CANCELLED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
