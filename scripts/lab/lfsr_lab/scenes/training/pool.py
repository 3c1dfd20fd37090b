"""A pool of Blender processes that take scene numbers from one list.

A worker reads numbers from its standard input, one a line, and answers each with
one record of ``lfsr_core.render.protocol``. A worker that dies costs the scene it was at, no more;
bad input, which every scene would meet, ends the run.
"""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Sequence

from lfsr_core.errors import LfsrError
from lfsr_core.render.protocol import emit, parse_progress

Work = Callable[[int], dict[str, float]]


def attempt(work: Work, index: int) -> bool:
    """Do one scene and report how it went; False where it failed. LfsrError passes through."""
    try:
        emit(stage="scene", index=index, seconds=work(index))
    except LfsrError:
        raise
    except Exception as error:
        # One bad scene must not end a run of thousands; it is reported and counted.
        traceback.print_exc(file=sys.stderr)
        emit(stage="failed", index=index, message=f"{type(error).__name__}: {error}")
        return False
    return True


def serve(work: Work) -> None:
    """A worker's life: do the scenes whose numbers come in."""
    for line in iter(sys.stdin.readline, ""):
        attempt(work, int(line))


def run_pool(command: Sequence[str], workers: int, indices: Sequence[int]) -> list[int]:
    """Have ``workers`` processes of ``command`` do the scenes; the numbers that failed, sorted.

    LfsrError where a worker met one.
    """
    waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
    for index in indices:
        waiting.put(index)
    failed: list[int] = []
    errors: list[str] = []
    threads = [threading.Thread(target=_lead, args=(command, waiting, failed, errors)) for _ in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise LfsrError(errors[0])
    return sorted(failed)


def _lead(command: Sequence[str], waiting: queue.SimpleQueue[int], failed: list[int], errors: list[str]) -> None:
    """Keep one worker busy, and replace it if it dies."""
    worker = None
    while not errors and not waiting.empty():
        try:
            index = waiting.get_nowait()
        except queue.Empty:
            break
        worker = worker or subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        answer = _ask(worker, index) or _obituary(worker, index)
        if answer["stage"] == "error":
            errors.append(answer["message"])
            break
        emit(**{name: value for name, value in answer.items() if name != "dead"})
        if answer["stage"] == "failed":
            failed.append(index)
        worker = None if "dead" in answer else worker
    if worker:
        worker.stdin.close()
        worker.wait()


def _obituary(worker: subprocess.Popen, index: int) -> dict[str, object]:
    return {"stage": "failed", "index": index, "message": f"the worker ended with code {worker.wait()}", "dead": True}


def _ask(worker: subprocess.Popen, index: int) -> dict | None:
    """The worker's answer for one scene; None where it died."""
    try:
        worker.stdin.write(f"{index}\n")
        worker.stdin.flush()
    except BrokenPipeError:
        return None
    return next((record for line in worker.stdout if (record := parse_progress(line))), None)
