"""What the add-on asks for: one task in a process of its own.

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
from lfsr_core.files import read_json, system_errors
from lfsr_core.render.protocol import EXIT_BAD_INPUT, EXIT_CANCELLED, emit, repeated
from lfsr_core.tasks import export_tasks, frame_tasks, plan_task, sequence_task
from lfsr_core.tasks.task import Task

TASKS = {task.__name__: Task(task) for task in (
    frame_tasks.upscale, frame_tasks.decode, frame_tasks.check, frame_tasks.choose, frame_tasks.compare,
    export_tasks.view, export_tasks.export)}
TASKS |= {task.__name__: Task(task, starts_processes=True) for task in (plan_task.plan, sequence_task.animation)}


def main(arguments: list[str]) -> int:
    """Run the task file named in ``arguments``; the process's exit code."""
    try:
        data = read_json(arguments[0], "a task of the add-on")
        task = TASKS[data.pop("task")]
        _end_on_request(task)
        with system_errors(), repeated():
            result = task.run(**data)
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        return EXIT_CANCELLED
    emit(stage="done", **result)
    return 0


def _end_on_request(task: Task) -> None:
    """Let a signal end the task, and the end of standard input, which comes with the end of Blender."""
    signal.signal(signal.SIGTERM, _unwind if task.starts_processes else _leave)
    threading.Thread(target=_end_with_parent, args=(task,), daemon=True, name="lfsr-parent").start()


def _end_with_parent(task: Task) -> None:
    # Not sys.stdin: a thread that holds its lock aborts Python at exit.
    while os.read(0, 1):
        pass
    if task.starts_processes:
        os.kill(os.getpid(), signal.SIGTERM)
    else:
        _leave()


def _unwind(*_: object) -> None:
    raise KeyboardInterrupt


def _leave(*_: object) -> None:
    # What is half-written lies in temporary files, which the add-on's staging folder takes with it.
    os._exit(EXIT_CANCELLED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
