"""Stopping a headless render at once: Cycles does not return to Python before its image is done."""

from __future__ import annotations

import os
import shutil
import signal
import threading
from collections.abc import Callable

import bpy

from lfsr_core.render.protocol import ENDS_WITH_INPUT

from ..render.cycles import UNFINISHED

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def on_signals(end: Callable[[], None]) -> None:
    """Remove unfinished files and call ``end``, which must end the process, when a signal stops it.

    The main thread sits inside Cycles, where no Python handler runs; the signal's
    number arrives through a pipe that another thread reads. Scene settings need
    no restoring here: the process ends and saves nothing.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for number in SIGNALS:
        signal.signal(number, _leave_to_thread)
    threading.Thread(target=_wait, args=(reader, end), daemon=True, name="lfsr-stop").start()
    if os.environ.get(ENDS_WITH_INPUT):
        threading.Thread(target=_wait_for_end_of_input, args=(end,), daemon=True, name="lfsr-parent").start()


def _leave_to_thread(*_: object) -> None:
    """A handler must exist for the signal to reach the pipe instead of Python's own KeyboardInterrupt."""


def _wait(reader: int, end: Callable[[], None]) -> None:
    while os.read(reader, 1)[0] not in SIGNALS:
        pass
    _leave(end)


def _wait_for_end_of_input(end: Callable[[], None]) -> None:
    """The process that started this one holds the other end of standard input: it ends when that dies."""
    while os.read(0, 1):
        pass
    _leave(end)


def _leave(end: Callable[[], None]) -> None:
    for path in list(UNFINISHED):
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    end()
