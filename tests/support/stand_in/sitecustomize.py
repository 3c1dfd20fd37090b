"""Make Python take Linux for the system that LFSR_STAND_IN names, "win32" or "darwin", before lfsr_core is imported.

Every Python that has this folder in PYTHONPATH runs it as it starts. What the other system lacks is removed; what it
refuses is refused: Windows neither replaces nor removes a file that any process has open or mapped.
"""

import contextlib
import ctypes
import fcntl
import importlib
import itertools
import os
import signal
import subprocess
import sys
import types
import warnings
from pathlib import Path

# Other packages ask for the system as they are imported; they are those of Linux.
OTHERS = ("asyncio", "concurrent.futures", "importlib.metadata", "multiprocessing", "numpy", "OpenImageIO", "platform",
          "PyOpenColorIO", "selectors", "shutil", "tempfile", "threadpoolctl", "uuid", "webbrowser")
LACKING = {"darwin": ("sched_getaffinity", "sched_setaffinity", "posix_fadvise", "memfd_create", "pidfd_open")}
LACKING["win32"] = (*LACKING["darwin"], "killpg", "set_blocking", "setpriority", "getpriority", "nice", "fork",
                    "setsid", "getpgid", "getuid", "geteuid", "uname", "mkfifo", "statvfs", "getloadavg")
SIGNALS = ("SIGKILL", "SIGHUP", "SIGQUIT", "SIGALRM", "SIGUSR1")
NEW_GROUP = 0x200


class Kernel:
    """Job objects, as process groups."""

    handles = itertools.count(1)
    killpg, kill = os.killpg, signal.SIGKILL

    def __init__(self, name: str) -> None:
        assert name == "kernel32"
        self.members: dict[int, int] = {}
        self.CreateJobObjectW = lambda *_: next(self.handles)
        self.CreateJobObjectW.restype = None

    def SetInformationJobObject(self, job, kind, limits, size):
        assert job and kind == 9 and size == len(limits) == 144 and limits.raw[17] & 0x20, "kill on close"

    def AssignProcessToJobObject(self, job, handle):
        self.members[job.value] = handle.value

    def TerminateJobObject(self, job, _code):
        with contextlib.suppress(ProcessLookupError):
            Kernel.killpg(self.members[job.value], Kernel.kill)

    def CloseHandle(self, job):
        self.TerminateJobObject(job, 1)


def held(path, dir_fd=None) -> bool:
    """True if a process of this system has the file, or a file in the folder, open or mapped."""
    real = os.path.realpath(os.path.join(os.readlink(f"/proc/self/fd/{dir_fd}"), path) if dir_fd is not None else path)
    if not os.path.lexists(real):
        return False
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # ended since
            is_ours = b"LFSR_STAND_IN" in (process / "environ").read_bytes()
            for number in os.listdir(process / "fd") if is_ours else ():
                with contextlib.suppress(OSError):  # closed since
                    target = os.readlink(process / "fd" / number)
                    if (target == real or target.startswith(f"{real}/")) and os.path.isfile(target):
                        return True
            lines = (process / "maps").read_text(encoding="utf-8", errors="replace") if is_ours else ""
            if f" {real}\n" in lines or f" {real}/" in lines:
                return True
    return False


def refusing(real, count: int):
    """As ``real``, a function of ``count`` paths; PermissionError where one of them is held."""
    def refused(*arguments, dir_fd=None, **options):
        for path in arguments[:count]:
            if held(path, dir_fd):
                error = PermissionError(13, "The process cannot access the file because it is being used by another "
                                            "process", str(path))
                error.winerror = 32
                raise error
        return real(*arguments, **options, **({} if dir_fd is None else {"dir_fd": dir_fd}))
    return refused


def lock(file: int, mode: int, count: int) -> None:
    """msvcrt.locking"""
    assert (mode, count) == (2, 1)
    FLOCK(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def start(self, *arguments, creationflags=0, start_new_session=False, preexec_fn=None, **options) -> None:
    """subprocess.Popen of Windows"""
    assert not start_new_session and preexec_fn is None, "not supported on Windows platforms"
    POPEN(self, *arguments, start_new_session=bool(creationflags & NEW_GROUP), **options)
    self._handle = self.pid


def become(system: str) -> None:
    """Take this process for one of ``system``."""
    words = " ".join(sys.orig_argv)  # a Blender that only says its version imports none
    for name in () if "--version" in words else OTHERS + ("bpy",) * ("from_sources" in words):
        importlib.import_module(name)
    warnings.filterwarnings("error", category=EncodingWarning, module="lfsr_core|blender_addon|tests")
    for name in LACKING[system]:
        if hasattr(os, name):
            delattr(os, name)
    os.process_cpu_count = os.cpu_count  # since Python 3.13, by sched_getaffinity
    if system == "win32":
        become_windows()
    sys.platform = system


def become_windows() -> None:
    for name in SIGNALS:
        delattr(signal, name)
    for name, count in {"replace": 2, "rename": 2, "unlink": 1, "remove": 1}.items():
        setattr(os, name, refusing(getattr(os, name), count))
    for name, value in {"CREATE_NEW_PROCESS_GROUP": NEW_GROUP, "CREATE_NO_WINDOW": 1 << 27,
                        "BELOW_NORMAL_PRIORITY_CLASS": 1 << 14}.items():
        setattr(subprocess, name, value)
    subprocess.Popen.__init__ = start
    ctypes.WinDLL = Kernel
    sys.modules["fcntl"] = sys.modules["resource"] = sys.modules["pwd"] = None
    sys.modules["msvcrt"] = types.SimpleNamespace(LK_NBLCK=2, locking=lock)


FLOCK, POPEN = fcntl.flock, subprocess.Popen.__init__
if os.environ.get("LFSR_STAND_IN"):
    become(os.environ["LFSR_STAND_IN"])
