"""Child processes, Blender among them: what they write, how they are started and stopped.

They write ``LFSR {json}`` lines on their standard output. The last one has the stage "done", "error" or "cancelled".
``repeated`` writes the last progress again while there is nothing new. No child outlives its parent.
"""

import _thread
import collections
import contextlib
import ctypes
import dataclasses
import glob
import importlib.util
import json
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

from lfsr_core.base.messages import LfsrError, Notice, Progress

SECONDS_TO_STOP = 5.0
LINES_IN_MESSAGE, MOST_LAST_WORDS = 3, 120
PACKAGES = Path(__file__).resolve().parents[2]  # folder of lfsr_core
OLDEST_BLENDER, SECONDS_TO_ANSWER = (4, 5), 60
# Where installers and Steam put Blender. What the Microsoft Store and snap install is on PATH.
PLACES = {
    "win32": ("$ProgramFiles/Blender Foundation/Blender */blender.exe",
              "${ProgramFiles(x86)}/Steam/steamapps/common/Blender/blender.exe"),
    "darwin": ("/Applications/Blender*.app/Contents/MacOS/Blender",
               "~/Applications/Blender*.app/Contents/MacOS/Blender",
               "~/Library/Application Support/Steam/steamapps/common/Blender/Blender.app/Contents/MacOS/Blender"),
    "linux": ("~/.steam/steam/steamapps/common/Blender/blender",)}
# Ctrl-C in the terminal reaches this process only, which then stops the child.
if sys.platform == "win32":
    START: dict[str, Any] = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW}

    class ProcessGroup:
        """A job object, which ends its processes when this process ends, however that happens."""

        # JOBOBJECT_EXTENDED_LIMIT_INFORMATION of 64-bit Windows: its bytes, LimitFlags and PriorityClass.
        LIMITS, BYTES, FLAGS_AT, PRIORITY_AT = 9, 144, 16, 56
        KILL_ON_JOB_CLOSE, HAS_PRIORITY = 0x2000, 0x20

        def __init__(self, process: subprocess.Popen[str], low_priority: bool) -> None:
            """Put ``process``, which was started with ``START``, into a new job."""
            self._kernel = ctypes.WinDLL("kernel32")
            self._kernel.CreateJobObjectW.restype = ctypes.c_void_p
            self._job = ctypes.c_void_p(self._kernel.CreateJobObjectW(None, None))
            limits = ctypes.create_string_buffer(self.BYTES)
            struct.pack_into("<I", limits, self.FLAGS_AT, self.KILL_ON_JOB_CLOSE | low_priority * self.HAS_PRIORITY)
            struct.pack_into("<I", limits, self.PRIORITY_AT, low_priority * subprocess.BELOW_NORMAL_PRIORITY_CLASS)
            self._kernel.SetInformationJobObject(self._job, self.LIMITS, limits, self.BYTES)
            handle = ctypes.c_void_p(int(process._handle))  # type: ignore[attr-defined]  # it has no public name
            self._kernel.AssignProcessToJobObject(self._job, handle)

        def kill(self) -> None:
            """Kill the processes that are left."""
            self._kernel.TerminateJobObject(self._job, 1)

        def __del__(self) -> None:
            self._kernel.CloseHandle(self._job)

else:
    START: dict[str, Any] = {"start_new_session": True}

    class ProcessGroup:
        """A process group."""

        NICE = 10  # by which low priority is lower

        def __init__(self, process: subprocess.Popen[str], low_priority: bool) -> None:
            """``process`` leads the group; it was started with ``START``."""
            self._id = process.pid
            if low_priority:
                with contextlib.suppress(ProcessLookupError):  # it has ended already
                    os.setpriority(os.PRIO_PGRP, process.pid, os.getpriority(os.PRIO_PROCESS, 0) + self.NICE)

        def kill(self) -> None:
            """Kill the processes that are left."""
            with contextlib.suppress(ProcessLookupError, PermissionError):  # macOS says the latter of zombies
                os.killpg(self._id, signal.SIGKILL)
PROGRESS_PREFIX = "LFSR "
RENDERED_STAGE, FAILED_STAGE = "rendered", "failed"  # a request's folder is complete; its frame cannot be rendered
STAY = "stay"  # word for request files: they come later, one a line on standard input
LAST_STAGES = ("done", "error", "cancelled")
EXIT_BAD_INPUT, EXIT_CANCELLED = 2, 130
# Environment variable that tells a process to end when its standard input does.
ENDS_WITH_INPUT = "LFSR_ENDS_WITH_INPUT"
# Environment variable that names Blender's folder to a process outside it, which finds libraries there.
BLENDER_FOLDER = "LFSR_BLENDER_FOLDER"
# A program that opens a page in a browser. It waits for xdg-open, whose start Python takes for success.
OPENS = """import contextlib, os, signal, subprocess, sys, webbrowser
del subprocess.Popen.__del__  # it would take the exit code of a child that has just ended
is_open = webbrowser.open(sys.argv[1])
with contextlib.suppress(AttributeError, ChildProcessError):
    signal.signal(signal.SIGALRM, lambda *_: sys.exit(not is_open))
    signal.alarm(3)
    is_open &= not os.wait()[1]
sys.exit(not is_open)
"""
SECONDS_OF_SILENCE = 1.0  # short, so that a program that prints a line every few seconds has something to print
LONGEST_WAIT = 1.0  # seconds that the last record waits for another that is being written
_speaking = threading.Lock()
_last: tuple[dict[str, Any], float] | None = None  # record of a step under way, and when it was new


def emit(**record: Any) -> None:
    """Write one record; ``stage`` is always among its keys."""
    global _last
    if "notice" not in record:
        _last = None if record["stage"] in (*LAST_STAGES, RENDERED_STAGE, FAILED_STAGE) else (record, time.monotonic())
    with _speaking:
        _write(record)


def emit_last(**record: Any) -> None:
    """Write the record of a process that ends now; no other thread can write one after it."""
    # The lock is not released: other threads wait until the process ends. A thread that holds it and waits for a reader
    # that has gone must not delay this one for long.
    _speaking.acquire(timeout=LONGEST_WAIT)
    _write(record)


def _cpu() -> float:
    return round(time.process_time(), 2)


def emit_told(told: Progress | Notice) -> None:
    """Write progress or a notice as a record, which ``told_of`` reads; a ``Tell``."""
    if isinstance(told, Notice):
        emit(stage="notice", notice=told.code, values=told.values)
    else:
        emit(stage=told.stage, fraction=round(told.fraction, 4), message=told.detail,
             left=told.left if told.left is None else round(told.left, 1),
             cpu=_cpu() if told.cpu is None else told.cpu, repeated=told.repeated)


def told_of(record: dict[str, Any]) -> Progress | Notice | None:
    """Return the progress or the notice in a record, None where it is another; LfsrError for FAILED_STAGE."""
    if record["stage"] == FAILED_STAGE:
        raise LfsrError(record["message"])
    if "notice" in record:
        return Notice(record["notice"], record["values"])
    if "fraction" not in record:
        return None
    return Progress(record["stage"], min(1.0, float(record["fraction"])), str(record.get("message", "")),
                    record.get("left"), record.get("cpu"), bool(record.get("repeated")))


@contextmanager
def beside(work: Callable[[threading.Event], None], name: str) -> Iterator[None]:
    """Run ``work`` in a thread called ``name`` beside the block; it returns once its event is set, after the block."""
    ended = threading.Event()
    thread = threading.Thread(target=work, args=(ended,), daemon=True, name=name)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def repeated(silence: float = SECONDS_OF_SILENCE) -> contextlib.AbstractContextManager[None]:
    """Inside the block, write the last progress again after each ``silence`` seconds without another.

    Its message then ends with the seconds since it was new. Blender lets other threads run while it renders.
    """
    def repeat(ended: threading.Event) -> None:
        while not ended.wait(silence):
            last = _last
            seconds = time.monotonic() - last[1] if last else 0.0
            if last and seconds >= silence:
                message = f"{last[0].get('message', '')}, for {seconds:.0f} s".removeprefix(", ")
                with _speaking:
                    _write(last[0] | {"message": message, "cpu": _cpu(), "repeated": True})

    return beside(repeat, "lfsr-progress")


def parse_progress(line: str) -> dict[str, Any] | None:
    """Return the record in a line, None for any other line of Blender's output.

    A record may follow other text on its line: Blender cuts its own long messages, and the line end with them.
    """
    if (start := line.find(PROGRESS_PREFIX + "{")) < 0:
        return None
    try:
        record, _ = json.JSONDecoder().raw_decode(line, start + len(PROGRESS_PREFIX))
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) and "stage" in record else None


def _write(record: dict[str, Any]) -> None:
    # In one write, because Cycles' thread writes too.
    sys.stdout.write(PROGRESS_PREFIX + json.dumps(record) + "\n")
    sys.stdout.flush()


def interrupt_main(number: signal.Signals) -> None:
    """Raise a signal in the main thread, and wake it where it waits for another."""
    if sys.platform == "win32":
        _thread.interrupt_main(number)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, number)


class CrashError(LfsrError):
    """A child process ended without a sentence of its own: another try may succeed."""


class Child:
    """A process that works for this one; as a context manager it is stopped at the end of the block.

    Its standard input is a pipe that closes when this process ends, however that happens; a child that finds
    ENDS_WITH_INPUT in its environment then ends too. That is also how ``stop`` asks it to end.
    """

    _living: ClassVar["weakref.WeakSet[Child]"] = weakref.WeakSet()

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

    def records(self) -> Iterator[dict[str, Any]]:
        """Yield the records that it writes, until the last, or until it closes its output."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._log(line)
            if (record := parse_progress(line)) is not None:
                self.last = record
                yield record
                if record["stage"] in LAST_STAGES:  # a process that it has started may hold its output open
                    return
            elif line.strip():
                self._tail.append(line.strip())

    def ask(self, line: str) -> None:
        """Write a line to its standard input; where it has ended, ``wait`` and ``crash`` tell why."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(f"{line}\n")
            self._process.stdin.flush()

    def wait(self) -> int:
        """Wait for the end and return the exit code; LfsrError with the child's own sentence after bad input."""
        if (code := self._process.wait()) == EXIT_BAD_INPUT and self.last.get("stage") == "error":
            raise LfsrError(str(self.last.get("message")))
        return code

    def is_done(self) -> bool:
        """Wait for the end; True if it reported the stage "done" and no failure. Errors as of ``wait``."""
        return self.wait() == 0 and self.last.get("stage") == "done"

    def crash(self, what: str, advice: str) -> CrashError:
        """Return the error of a process that has ended too early: ``what``, exit code, last lines and ``advice``.

        ``what``: such as "the render stopped with"; ``advice``: such as "try again".
        """
        code = self._process.wait()
        reason = f"signal {-code}" if code < 0 else f"exit code {code}"
        if code == -getattr(signal, "SIGKILL", 0):
            reason += ", as where memory runs out,"
        doing = f" in {text!r}" if (text := self.last.get("message")) else ""
        lines = " / ".join(self._tail)[-MOST_LAST_WORDS:]
        last = f", last printing {lines!r}" if lines else ""
        return CrashError(f"{what} {reason}{doing} before it was done{last}: {advice}")

    def stop(self, seconds: float = SECONDS_TO_STOP) -> None:
        """End the process and its own children: ask first, and kill what has not ended after ``seconds``."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):  # OSError: it has ended before it read all
            self._process.stdin.close()
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


class Starts(Protocol):
    """Anything that knows how to start Blender."""

    def command(self, *requests: Path | str) -> list[str]:
        """Return the command line that renders the requests in ``requests``, or STAY, one after the other."""


@dataclasses.dataclass(frozen=True)
class Blender:
    """How to start Blender."""

    executable: str | None = None  # path of Blender, None for the bpy wheel of this Python

    def command(self, *requests: Path | str) -> list[str]:
        """Return the command line that renders the requests in ``requests``, or STAY, one after the other."""
        spec = importlib.util.find_spec("blender_addon")  # which is not imported here
        if spec is None or not spec.submodule_search_locations:
            raise LfsrError("the package blender_addon is not installed beside lfsr_core: install LFSR again")
        folder = next(iter(spec.submodule_search_locations))
        return self.script_command(Path(folder, "headless", "from_sources.py"), *map(str, requests))

    def script_command(self, script: Path, *arguments: str) -> list[str]:
        """Return the command line that runs a Python ``script`` inside Blender."""
        if self.executable is None:
            # -P: modules beside the script must not hide others of the same name.
            return [sys.executable, "-P", str(script), "--", *arguments]
        return [self.executable, "--background", "--factory-startup", "--python-exit-code", "1",
                "--python", str(script), "--", *arguments]


def find_blender(executable: str | None = None) -> Blender:
    """Return the Blender asked for, else the bpy wheel, else ``blender`` on PATH, else the newest that is installed.

    LfsrError if there is none.
    """
    if executable is None and importlib.util.find_spec("bpy") is not None:
        return Blender()
    if executable and executable.rstrip("/").endswith(".app") and os.path.isdir(executable):  # a bundle of macOS
        executable = os.path.join(executable, "Contents", "MacOS", "Blender")
    path = shutil.which(executable or "blender")
    if path is None and not executable:
        patterns = (os.path.expanduser(os.path.expandvars(place)) for place in PLACES.get(sys.platform, ()))
        path = max((path for pattern in patterns for path in glob.glob(pattern)), default=None,
                   key=lambda path: [int(number) for pair in re.findall(r"(\d+)\.(\d+)", path) for number in pair])
    if path is None:
        raise LfsrError(
            f"blender executable {executable!r} was not found: give the path of Blender 4.5 or newer" if executable
            else "Blender was not found, neither the bpy package nor an installed Blender: "
                 "install the 'blender' extra or give --blender PATH")
    try:
        _, answer = output_of([path, "--version"], seconds=SECONDS_TO_ANSWER)
    except OSError as error:
        raise LfsrError(f"{path} cannot be started ({error}): give another with --blender PATH") from None
    if (version := re.search(r"Blender (\d+)\.(\d+)", answer)) is None:
        raise LfsrError(f"{path} does not say that it is Blender: give the executable with --blender PATH")
    if (int(version[1]), int(version[2])) < OLDEST_BLENDER:
        raise LfsrError(f"{path} is {version[0]}, but 4.5 or newer is needed: give another with --blender PATH")
    return Blender(path)
