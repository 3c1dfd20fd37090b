"""Stop a headless render at once: Cycles does not return to Python before its image is done."""

from __future__ import annotations

import contextlib
import os
import shutil
import threading
from collections.abc import Callable

import bpy

from lfsr_core.process.protocol import ENDS_WITH_INPUT

from ..render.output import UNFINISHED

STANDARD_INPUT = 0


def with_input(end: Callable[[], None]) -> None:
    """With ENDS_WITH_INPUT in the environment, remove unfinished files and call ``end`` at the end of standard input.

    ``end`` must end the process. The process that started this one holds the other end of the pipe: it closes it to
    stop the render, and the system does when it dies. The main thread sits inside Cycles, so another one waits for it.
    """
    if os.environ.get(ENDS_WITH_INPUT):
        threading.Thread(target=_wait, args=(end,), daemon=True, name="lfsr-stop").start()


def _wait(end: Callable[[], None]) -> None:
    while os.read(STANDARD_INPUT, 1):
        pass
    for path in list(UNFINISHED):
        with contextlib.suppress(OSError):  # Windows removes no open file: the next run does
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    end()
