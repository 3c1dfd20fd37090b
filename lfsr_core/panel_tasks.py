"""The second stage for the add-on: one task in a process of its own.

    python -m lfsr_core.panel_tasks TASK.json

Progress and the result are ``LFSR {json}`` lines on standard output, as the
render stage writes them; the last one has the stage "done" or "error". The
process ends when its standard input does, so that none outlives Blender.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core import eia
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, read_json
from lfsr_core.frame import EIA_FILE, MASK_FILE, read_frame

BAD_INPUT, CANCELLED = 2, 130


def say(**record: Any) -> None:
    """One line of the progress protocol."""
    sys.stdout.write("LFSR " + json.dumps(record) + "\n")
    sys.stdout.flush()


def upscale(folder: str, method: str, linear_exr: bool = False, views: str | None = None) -> dict[str, Any]:
    """Finish a rendered frame folder; ``views`` names a file for ``decode``. Result: method and seconds per stage."""
    from lfsr_core.pipeline import upscale_frame

    report = upscale_frame(folder, method, linear_exr=linear_exr, progress=_progress)
    if views:
        decode(folder, views)
    return {"method": report["method"], "seconds": report["seconds"]}


def decode(folder: str, views: str) -> dict[str, Any]:
    """Write the decoded views of a finished folder as a .npy, uint8 (py, px, sy, sx, 3).

    Row 0 is the topmost camera; one view is contiguous, so that a reader that maps
    the file touches a few kB per view. Result: its shape.
    """
    from lfsr_core.contact_sheet import view_order
    from lfsr_core.image_io import read_png

    _progress("preview", 0.0, "decoding views")
    profile = read_frame(folder).display
    image = view_order(read_png(Path(folder, EIA_FILE)), profile)
    decoded = np.ascontiguousarray(eia.to_views(image, profile.lenses))
    with atomic_path(views) as temporary, temporary.open("wb") as file:
        np.save(file, decoded)
    return {"shape": list(decoded.shape)}


def choose(folder: str, count: int, seed: int = 0) -> dict[str, Any]:
    """Lenses of a finished folder to compare: (row, column) pairs, none for all if ``count`` is 0 or too large."""
    from lfsr_core.image_io import read_mask
    from lfsr_core.lens_choice import choose_lenses

    mask = read_mask(Path(folder, MASK_FILE))
    whole = count < 1 or count >= mask.size
    return {"lens_list": None if whole else [list(lens) for lens in choose_lenses(mask, count, seed)]}


def check(method: str) -> dict[str, Any]:
    """LfsrError if this Python cannot run ``method``, as a network without PyTorch: better told before the render."""
    from lfsr_core.upscale import method as load

    return {"method": load(method).name}


def compare(folder: str, reference: str) -> dict[str, Any]:
    """Metrics of a finished folder against a reference folder, also written into its report."""
    from lfsr_core.comparison import compare_folders

    _progress("compare", 0.0, "comparing")
    return {"metrics": compare_folders(folder, reference)}


TASKS: dict[str, Callable[..., dict[str, Any]]] = {
    "upscale": upscale, "decode": decode, "check": check, "choose": choose, "compare": compare}


def main(arguments: list[str]) -> int:
    """Run the task file named in ``arguments``; the process's exit code."""
    signal.signal(signal.SIGTERM, _stop)
    threading.Thread(target=_end_with_parent, daemon=True, name="lfsr-parent").start()
    try:
        task = read_json(arguments[0], "a task of the add-on")
        result = TASKS[task.pop("task")](**task)
    except LfsrError as error:
        say(stage="error", message=str(error))
        return BAD_INPUT
    say(stage="done", **result)
    return 0


def _progress(stage: str, fraction: float, message: str) -> None:
    say(stage=stage, fraction=round(fraction, 4), message=message)


def _stop(_signal: int, _stack: object) -> None:
    # What is half-written lies in temporary files, which the add-on's staging folder takes with it.
    os._exit(CANCELLED)


def _end_with_parent() -> None:
    # Not sys.stdin: a thread that holds its lock aborts Python at exit.
    while os.read(0, 1):
        pass
    os._exit(CANCELLED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
