"""Child processes: start them, read their ``LFSR {json}`` lines, stop them without leaving orphans."""

from __future__ import annotations

import collections
import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Self

from lfsr_core.errors import LfsrError
from lfsr_core.render.protocol import ENDS_WITH_INPUT, EXIT_BAD_INPUT, parse_progress

SECONDS_TO_STOP = 5.0
LINES_IN_MESSAGE, MOST_LAST_WORDS = 3, 120
NICE = 10  # by which low priority is lower on POSIX


class CrashError(LfsrError):
    """A child process ended without a sentence of its own: another try may succeed."""


class Child:
    """A process that works for this one; as a context manager it is stopped at the end of the block.

    Its standard input is a pipe that closes when this process ends, however that happens; a child that finds
    ``protocol.ENDS_WITH_INPUT`` in its environment then ends too.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str] | None = None,
                 log: Callable[[str], object] = lambda line: None, low_priority: bool = False) -> None:
        """Start ``command``; OSError where that fails. ``environment`` replaces our own; ``log`` gets each line.

        ``low_priority``: the child and its own children leave the processor to other programs.
        """
        self.last: dict[str, Any] = {}  # record that it wrote last
        self._log = log
        self._tail: collections.deque[str] = collections.deque(maxlen=LINES_IN_MESSAGE)
        inherited = os.environ if environment is None else environment
        self._process = _start(command, {**inherited, "PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8",
                                          ENDS_WITH_INPUT: "1"}, low_priority)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def pid(self) -> int:
        """Process id, and on POSIX the id of its process group."""
        return self._process.pid

    def is_running(self) -> bool:
        """Return False once the process has ended."""
        return self._process.poll() is None

    def records(self) -> Iterator[dict[str, Any]]:
        """Yield the records that it writes, until it closes its output."""
        assert self._process.stdout is not None
        with self._process.stdout as output:
            for line in output:
                self._log(line)
                record = parse_progress(line)
                if record is not None:
                    self.last = record
                    yield record
                elif line.strip():
                    self._tail.append(line.strip())

    def wait(self) -> int:
        """Wait for the end and return the exit code; LfsrError with the child's own sentence after bad input."""
        code = self._process.wait()
        if code == EXIT_BAD_INPUT and self.last.get("stage") == "error":
            raise LfsrError(str(self.last.get("message")))
        return code

    def is_done(self) -> bool:
        """Wait for the end; True if it reported the stage "done" and no failure. Errors as of ``wait``."""
        return self.wait() == 0 and self.last.get("stage") == "done"

    def crash(self, what: str, advice: str) -> CrashError:
        """Return the error of a process that has ended too early, from ``what``, its end, and ``advice``.

        ``what`` is as "the render stopped with", ``advice`` as "try again".
        """
        code = self._process.wait()
        reason = f"signal {-code}" if code < 0 else f"exit code {code}"
        lines = (" / ".join(self._tail) or "nothing")[-MOST_LAST_WORDS:]
        return CrashError(f"{what} {reason} before it was done, last printing {lines!r}: {advice}")

    def stop(self, seconds: float = SECONDS_TO_STOP) -> None:
        """End the process and its own children: ask first, and kill what has not ended after ``seconds``."""
        if not self.is_running():
            return
        if self._process.stdin is not None:
            self._process.stdin.close()
        _ask_to_end(self._process)
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            _kill(self._process)
            self._process.wait()


def output_of(command: Sequence[str], environment: Mapping[str, str] | None = None,
              seconds: float | None = None) -> tuple[int, str]:
    """Run ``command`` to its end and return its exit code and what it printed.

    OSError where it cannot be started; TimeoutError, which is one, where it takes longer than ``seconds``.
    """
    with Child(command, environment) as child:
        try:
            output, _ = child._process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"no answer within {seconds:.0f} s") from None
    return child._process.returncode, output


def _start(command: Sequence[str], environment: dict[str, str], low_priority: bool) -> subprocess.Popen[str]:
    # A process group of its own: Ctrl-C in the terminal reaches this process only, which then stops the child.
    if sys.platform == "win32":
        flags, new_session = subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW, False
        if low_priority:
            flags |= subprocess.BELOW_NORMAL_PRIORITY_CLASS
    else:
        flags, new_session = 0, True
    process = subprocess.Popen(list(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               env=environment, text=True, encoding="utf-8", errors="replace",
                               creationflags=flags, start_new_session=new_session)
    if low_priority and sys.platform != "win32":
        with contextlib.suppress(ProcessLookupError):  # it has ended already
            os.setpriority(os.PRIO_PGRP, process.pid, os.getpriority(os.PRIO_PROCESS, 0) + NICE)
    return process


if sys.platform == "win32":
    def _ask_to_end(process: subprocess.Popen[str]) -> None:
        """Do nothing: the closed input has asked, and Windows has no polite signal for a process without a window."""

    def _kill(process: subprocess.Popen[str]) -> None:
        """Kill a process and its children."""
        subprocess.run(["taskkill", "/T", "/F", "/PID", str(process.pid)], capture_output=True, check=False)
        process.kill()
else:
    def _ask_to_end(process: subprocess.Popen[str]) -> None:
        """Send SIGTERM to a process and its children."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)

    def _kill(process: subprocess.Popen[str]) -> None:
        """Kill a process and its children."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
