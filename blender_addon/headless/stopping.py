"""Stop a headless render at once: Cycles does not return to Python before its image is done."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
from collections.abc import Callable

import bpy

from lfsr_core.render.protocol import ENDS_WITH_INPUT

from ..render.output import UNFINISHED

SIGNALS = (signal.SIGINT, signal.SIGTERM)
STANDARD_INPUT = 0


def on_signals(end: Callable[[], None]) -> None:
    """Remove unfinished files and call ``end``, which must end the process, when a signal stops it.

    The main thread sits inside Cycles, where no Python handler runs; the signal's number arrives through
    a pipe that another thread reads. Scene settings need no restoring: the process ends and saves nothing.
    With ENDS_WITH_INPUT in the environment, the end of standard input stops it too: the process that
    started this one holds the other end, and has died.
    """
    reader, writer = os.pipe()
    if sys.platform != "win32":
        os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for number in SIGNALS:
        # Without a handler the signal would not reach the pipe.
        signal.signal(number, lambda *_: None)
    _stop_at(reader, {bytes([number]) for number in SIGNALS}, end)
    if os.environ.get(ENDS_WITH_INPUT):
        _stop_at(STANDARD_INPUT, {b""}, end)


def _stop_at(file: int, last: set[bytes], end: Callable[[], None]) -> None:
    """Read ``file`` in a thread until one of the ``last`` bytes, then stop."""
    def wait() -> None:
        while os.read(file, 1) not in last:
            pass
        for path in list(UNFINISHED):
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
        shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
        end()

    threading.Thread(target=wait, daemon=True, name=f"lfsr-stop-{file}").start()
