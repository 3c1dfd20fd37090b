"""A child process together with those that it starts, so that none outlives its use."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import struct
import subprocess
import sys
from typing import Any

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
            self._kernel.AssignProcessToJobObject(self._job, _handle(process))

        def kill(self) -> None:
            """Kill the processes that are left."""
            self._kernel.TerminateJobObject(self._job, 1)

        def __del__(self) -> None:
            self._kernel.CloseHandle(self._job)

    def _handle(process: subprocess.Popen[str]) -> ctypes.c_void_p:
        """Windows' handle of a process, which has no public name."""
        return ctypes.c_void_p(int(process._handle))  # type: ignore[attr-defined]
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
