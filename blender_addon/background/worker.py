"""A process that works for the panel: started, followed without waiting, stopped.

Both stages run outside this Blender. A render inside it could neither be stopped
from Python (Cycles returns when its image is done) nor keep the artist from
editing a scene whose settings are borrowed, and a crash would take the artist's
work along. A background Blender that renders a temporary copy of the .blend has
none of that: the scene is never touched, cancelling is ending a process, and the
price is a second copy of the scene in memory and the seconds it takes to open.
"""

from __future__ import annotations

import collections
import contextlib
import os
import queue
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from typing import IO, Any

from lfsr_core.errors import LfsrError
from lfsr_core.render.protocol import ENDS_WITH_INPUT, EXIT_BAD_INPUT, parse_progress

SECONDS_TO_STOP = 1.0
LINES_IN_MESSAGE = 3


class Worker:
    """One child process that speaks the ``LFSR {json}`` protocol."""

    def __init__(self, name: str, command: Sequence[str], environment: dict[str, str]) -> None:
        """Start it; LfsrError where the executable cannot be started."""
        self.name, self.result = name, {}
        self._records: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._last_lines: collections.deque[str] = collections.deque(maxlen=LINES_IN_MESSAGE)
        # A pipe for its input ends with this process, whatever ends that.
        streams = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        environment = environment | {ENDS_WITH_INPUT: "1"}
        try:
            self._process = subprocess.Popen(list(command), **streams, env=environment, text=True, encoding="utf-8",
                                             errors="replace", **_own_group())
        except OSError as error:
            raise LfsrError(f"{name} cannot start {command[0]!r} ({error.strerror}): check the add-on's "
                            "preferences") from None
        self._reader = threading.Thread(target=self._read, args=(self._process.stdout,), daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def records(self) -> list[dict[str, Any]]:
        """The records it has emitted since the last call."""
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._records.get_nowait())
        return found

    def running(self) -> bool:
        """False once it has ended and all it emitted is in ``records``."""
        return self._process.poll() is None or self._reader.is_alive()

    def check(self) -> dict[str, Any]:
        """Its result after it ended well; LfsrError with its own sentence, or the end of its output."""
        code = self._process.wait()
        if code == EXIT_BAD_INPUT and self.result.get("stage") == "error":
            raise LfsrError(str(self.result.get("message")))
        if code != 0 or self.result.get("stage") != "done":
            reason = f"signal {-code}" if code < 0 else f"exit code {code}"
            lines = " / ".join(self._last_lines) or "nothing"
            raise LfsrError(f"{self.name} stopped with {reason} before it was done, last printing {lines!r}: "
                            "try again, or save and report it")
        return {name: value for name, value in self.result.items() if name != "stage"}

    def stop(self) -> None:
        """End it and its children now, politely first."""
        if self._process.poll() is None:
            _signal(self._process, force=False)
            try:
                self._process.wait(SECONDS_TO_STOP)
            except subprocess.TimeoutExpired:
                _signal(self._process, force=True)
                self._process.wait()
        self._reader.join(SECONDS_TO_STOP)

    def wait(self, seconds: float) -> None:
        """Let some time pass, less if it ends before."""
        ends = time.monotonic() + seconds
        while self.running() and time.monotonic() < ends:
            time.sleep(min(0.02, seconds))

    def _read(self, stream: IO[str]) -> None:
        for line in stream:
            record = parse_progress(line)
            if record is not None:
                self.result = record
                self._records.put(record)
            elif line.strip():
                self._last_lines.append(line.strip())
        stream.close()


def _own_group() -> dict[str, Any]:
    """Ctrl-C in Blender's terminal is Blender's business; the worker's own children end with it."""
    return {"start_new_session": True} if os.name == "posix" else {
        "creationflags": subprocess.CREATE_NO_WINDOW}


def _signal(process: subprocess.Popen[str], force: bool) -> None:
    if os.name != "posix":
        process.kill()
        return
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL if force else signal.SIGTERM)
