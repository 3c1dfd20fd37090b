"""Make scenes one after another, or several at once, each in a Blender process of its own."""

from __future__ import annotations

import functools
import subprocess
import sys
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.render.protocol import emit, parse_progress


def attempt(work: Callable[[int], dict[str, float]], index: int) -> bool:
    """Make one scene and report its seconds; return False where it failed. LfsrError passes through."""
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


def run_pool(command: Sequence[str], workers: int, indices: Sequence[int]) -> list[int]:
    """Run ``command --first INDEX`` for every scene, ``workers`` at once; return the numbers that failed.

    A process that dies costs one scene. Bad input, which every scene would meet, ends the run with LfsrError.
    """
    pool = ThreadPoolExecutor(max(workers, 1))
    try:
        made = pool.map(functools.partial(_run_process, command), indices)
        return [index for index, is_made in zip(indices, made, strict=True) if not is_made]
    finally:
        pool.shutdown(cancel_futures=True)


def _run_process(command: Sequence[str], index: int) -> bool:
    result = subprocess.run([*command, "--first", str(index), "--count", "1", "--workers", "1"],
                            stdout=subprocess.PIPE, text=True, check=False)
    records = [record for line in result.stdout.splitlines() if (record := parse_progress(line))]
    message = f"the process ended with code {result.returncode}"
    ended: dict[str, Any] = {"stage": "failed", "index": index, "message": message}
    answer = next((record for record in records if record["stage"] in ("scene", "failed", "error")), ended)
    if answer["stage"] == "error":
        raise LfsrError(answer["message"])
    emit(**answer)
    return bool(answer["stage"] == "scene")
