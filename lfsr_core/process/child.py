"""Child processes: start them, read their ``LFSR {json}`` lines, stop them without leaving orphans."""

from __future__ import annotations

import collections
import contextlib
import os
import subprocess
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Self

from lfsr_core.base.errors import LfsrError
from lfsr_core.process.group import START, ProcessGroup
from lfsr_core.process.protocol import ENDS_WITH_INPUT, EXIT_BAD_INPUT, LAST_STAGES, parse_progress

SECONDS_TO_STOP = 5.0
LINES_IN_MESSAGE, MOST_LAST_WORDS = 3, 120


class CrashError(LfsrError):
    """A child process ended without a sentence of its own: another try may succeed."""


class Child:
    """A process that works for this one; as a context manager it is stopped at the end of the block.

    Its standard input is a pipe that closes when this process ends, however that happens; a child that finds
    ``protocol.ENDS_WITH_INPUT`` in its environment then ends too. That is also how ``stop`` asks it to end.
    """

    _living: ClassVar[weakref.WeakSet[Child]] = weakref.WeakSet()

    def __init__(self, command: Sequence[str], environment: Mapping[str, str] | None = None,
                 log: Callable[[str], object] = lambda line: None, low_priority: bool = False) -> None:
        """Start ``command``; OSError where that fails. ``environment`` replaces our own; ``log`` gets each line.

        ``low_priority``: the child and its own children leave the processor to other programs.
        """
        self.last: dict[str, Any] = {}  # record that it wrote last
        self._log = log
        self._tail: collections.deque[str] = collections.deque(maxlen=LINES_IN_MESSAGE)
        inherited = os.environ if environment is None else environment
        self._process = subprocess.Popen(
            list(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            encoding="utf-8", errors="replace", **START,
            env={**inherited, "PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8", ENDS_WITH_INPUT: "1"})
        self._group = ProcessGroup(self._process, low_priority)
        self._living.add(self)

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
        """Yield the records that it writes, until the last, or until it closes its output."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._log(line)
            record = parse_progress(line)
            if record is not None:
                self.last = record
                yield record
                if record["stage"] in LAST_STAGES:  # a process that it has started may hold its output open
                    return
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
        lines = " / ".join(self._tail)[-MOST_LAST_WORDS:]
        last = f", last printing {lines!r}" if lines else ""
        return CrashError(f"{what} {reason} before it was done{last}: {advice}")

    def stop(self, seconds: float = SECONDS_TO_STOP) -> None:
        """End the process and its own children: ask first, and kill what has not ended after ``seconds``."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)
        self._group.kill()
        self._process.wait()
        self._living.discard(self)

    @classmethod
    def stop_all(cls, seconds: float = SECONDS_TO_STOP) -> None:
        """Stop every child of this process, as from a thread while others wait for them."""
        for child in list(cls._living):
            child.stop(seconds)


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
