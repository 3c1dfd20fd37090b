"""Render requests in Blender, as a process of its own, and publish their folders."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from lfsr_core.base.files import atomic_path, system_errors
from lfsr_core.base.notices import Notice, Tell, silent
from lfsr_core.base.records import write_record
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import LOG_FILE
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.staging import has_parts, release, remove, staging_folder
from lfsr_core.process.blender import Starts
from lfsr_core.process.child import Child
from lfsr_core.process.protocol import RENDERED_STAGE, told_of


def render_all(requests: Sequence[Request], blender: Starts, tell: Tell = silent,
               rendered: Callable[[Request], object] = lambda request: None) -> None:
    """Render ``requests`` one after the other in one Blender, which opens a scene once for all in a row that use it.

    Each folder is published as soon as it is rendered, whole or not at all, and ``rendered`` called with its request.
    A long render that ends early leaves its finished parts, and the same request continues from them. LfsrError with
    Blender's own sentence after bad input; CrashError with the last lines of its log, which is then copied into the
    folder; KeyboardInterrupt once Blender is stopped.
    """
    folders = {request.output: FrameFolder(request.output) for request in requests}
    for request in requests:
        folders[request.output].check_free(request.kind)
    with contextlib.ExitStack() as stack:
        waiting = [(request, stack.enter_context(staging_folder(folders[request.output].path)))
                   for request in requests]

        def publish() -> None:
            request, staging = waiting.pop(0)
            folders[request.output].publish(staging / "frame")
            release(staging)  # whoever is told of the render may finish it
            if waiting:  # the last staging folder has the log
                remove(staging)
            rendered(request)

        try:
            with system_errors():
                last = waiting[-1]
                files = [_request_file(request, staging, folders[request.output].parts)
                         for request, staging in waiting]
                temporary = last[1] / "temporary"  # not the system's, where a Blender that is killed leaves its files
                temporary.mkdir()
                environment = os.environ | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(temporary.resolve()))
                log_file = last[1] / LOG_FILE
                with (log_file.open("w", encoding="utf-8") as log,
                      Child(blender.command(*files), environment, log.write) as child):
                    for record in child.records():
                        if record["stage"] == RENDERED_STAGE:
                            publish()
                        elif (told := told_of(record)) is not None:
                            tell(told)
                    if not child.is_done():
                        log.flush()
                        stored = Path((waiting or [last])[0][0].output, LOG_FILE)
                        with atomic_path(stored) as copy:
                            shutil.copyfile(log_file, copy)
                        raise child.crash("Blender stopped with", f"the whole log is {stored}")
                while waiting:  # a single request is not reported as rendered
                    publish()
        except BaseException:
            if waiting and has_parts(parts := folders[waiting[0][0].output].parts):
                tell(Notice("parts-kept", {"folder": str(parts)}))
            raise


def _request_file(request: Request, staging: Path, parts: Path) -> Path:
    """Write the request for Blender, which fills the folder "frame" beside it, and return its path."""
    frame = staging / "frame"
    frame.mkdir()
    path = staging / "request.json"
    write_record(path, dataclasses.replace(request, output=str(frame.resolve()), parts=str(parts.resolve())))
    return path
