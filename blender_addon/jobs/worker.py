"""A process that works for the panel: started, followed without waiting, stopped.

Both stages run outside this Blender. A render inside it could neither be stopped
from Python (Cycles returns when its image is done) nor let the artist edit the
scene, and a crash would take the artist's work along. The price is a second copy
of the scene in memory and the seconds that it takes to open.
"""

from __future__ import annotations

import collections
import threading
import time
from collections.abc import Sequence
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.process.child import Child

from . import runtime

SECONDS_TO_STOP = 1.0


class Worker:
    """One child process, whose records a thread collects."""

    def __init__(self, name: str, command: Sequence[str]) -> None:
        """Start it; LfsrError where the executable cannot be started."""
        self.name = name
        self._records: collections.deque[dict[str, Any]] = collections.deque()
        try:
            self._child = Child(command, runtime.environment(), low_priority=True)
        except OSError as error:
            raise LfsrError(f"{name} cannot start {command[0]!r} ({error.strerror}): check the add-on's "
                            "preferences") from None
        self.pid = self._child.pid
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def records(self) -> list[dict[str, Any]]:
        """Return the records that it has written since the last call; "heard" is when, of ``time.monotonic``."""
        return [self._records.popleft() for _ in range(len(self._records))]

    def running(self) -> bool:
        """Return False once it has ended and all that it wrote is in ``records``."""
        return self._child.is_running() or self._reader.is_alive()

    def check(self) -> dict[str, Any]:
        """Return its result after it ended well; LfsrError with its own sentence, or the end of its output."""
        if not self._child.is_done():
            raise self._child.crash(f"{self.name} stopped with", "try again, or save and report it")
        return {name: value for name, value in self._child.last.items() if name != "stage"}

    def stop(self) -> None:
        """End it and its children now, politely first."""
        self._child.stop(SECONDS_TO_STOP)
        self._reader.join(SECONDS_TO_STOP)

    def wait(self, seconds: float) -> None:
        """Wait for its end, at most ``seconds``."""
        self._reader.join(seconds)

    def _read(self) -> None:
        self._records.extend(record | {"heard": time.monotonic()} for record in self._child.records())
