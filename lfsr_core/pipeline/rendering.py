"""Render jobs in Blender, as a process of its own, and publish their folders."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, check_name, system_errors
from lfsr_core.base.progress import Progress
from lfsr_core.base.records import write_record
from lfsr_core.frames import frame
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.staging import parts_folder, parts_sentence, publish, release, remove, staging_folder
from lfsr_core.process.blender import Starts
from lfsr_core.process.child import Child
from lfsr_core.process.protocol import LAST_STAGES, RENDERED_STAGE

LOG_FILE = "blender.log"
ROOM = 70  # letters that the longest path in a staging folder has more than its target
RENDERED_FILES = {"render": (frame.LOW_RES_FILE,), "reference": frame.REFERENCE_FILES}
# Made from an older render of the same folder, so they would no longer match it.
DERIVED_FILES = (frame.EIA_FILE, frame.EIA_LINEAR_FILE, frame.PANEL_FILE, frame.MASK_FILE, frame.REPORT_FILE,
                 frame.VIEWER_FILE, frame.WORLD_FILE, LOG_FILE)
Warn = Callable[[str], None]
_Waiting = list[tuple[Request, Path]]  # jobs, with the hidden folders in which they are rendered


@dataclasses.dataclass(frozen=True)
class Listener:
    """Functions that are called while renders run."""

    progress: Progress | None = None  # with (stage, fraction, message)
    warn: Warn | None = None  # with a sentence that the user should know although it does not stop the render
    rendered: Callable[[Request], object] = lambda job: None  # with each job whose folder is complete


def run_job(job: Request, blender: Starts, progress: Progress | None = None, warn: Warn | None = None) -> None:
    """Render ``job`` and publish its folder, whole or not at all; ``progress`` and ``warn`` as of ``Listener``.

    A long render that ends early leaves its finished parts, and the same job continues from them. LfsrError with
    Blender's own sentence after bad input; CrashError with the last lines of its log, which is then copied into the
    job's folder; KeyboardInterrupt once Blender is stopped.
    """
    run_jobs([job], blender, Listener(progress, warn))


def run_jobs(jobs: Sequence[Request], blender: Starts, listener: Listener) -> None:
    """Render ``jobs`` one after the other in one Blender, which opens a scene once for all jobs in a row that use it.

    Each folder is published as soon as it is rendered. Errors as of ``run_job``, for the first job that fails.
    """
    for job in jobs:
        check_folder(Path(job.output), job.kind)
    with contextlib.ExitStack() as stack:
        waiting = [(job, stack.enter_context(staging_folder(Path(job.output)))) for job in jobs]
        try:
            with system_errors():
                _render(waiting, blender, listener)
        except BaseException:
            sentence = parts_sentence(_parts(waiting[0][0])) if waiting else ""
            if sentence and listener.warn:
                listener.warn(sentence)
            raise


def check_folder(folder: Path, kind: str) -> None:
    """LfsrError if ``folder`` is a file or holds another kind of render, which must not be lost."""
    check_name(folder.absolute(), ROOM)
    if folder.exists() and not folder.is_dir():
        raise LfsrError(f"{folder} is a file, but the output must be a folder: choose another name")
    for other, files in RENDERED_FILES.items():
        if other != kind and any((folder / name).exists() for name in files):
            raise LfsrError(f"{folder} already holds a {other}, but a {kind} was asked for: choose another folder")


def _render(waiting: _Waiting, blender: Starts, listener: Listener) -> None:
    """Render the ``waiting`` jobs; those that are published leave the list."""
    last = waiting[-1]
    command, log_file = blender.command(*[_write(*each) for each in waiting]), last[1] / LOG_FILE
    temporary = last[1] / "temporary"  # not the system's, where a Blender that is killed would leave its files
    temporary.mkdir()
    environment = os.environ | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(temporary.resolve()))
    with log_file.open("w", encoding="utf-8") as log, Child(command, environment, log.write) as child:
        for record in child.records():
            _take(record, waiting, listener)
        if not child.is_done():
            log.flush()
            stored = Path((waiting or [last])[0][0].output, LOG_FILE)
            with atomic_path(stored) as temporary:
                shutil.copyfile(log_file, temporary)
            raise child.crash("Blender stopped with", f"the whole log is {stored}")
    while waiting:  # a single job is not reported as rendered
        _publish(waiting, listener)


def _parts(job: Request) -> Path:
    return parts_folder(Path(job.output)).resolve()


def _write(job: Request, staging: Path) -> Path:
    """Write the job file for Blender, which fills the folder "frame" beside it, and return its path."""
    frame = staging / "frame"
    frame.mkdir()
    path = staging / "job.json"
    write_record(path, dataclasses.replace(job, output=str(frame.resolve()), parts=str(_parts(job))))
    return path


def _take(record: dict[str, Any], waiting: _Waiting, listener: Listener) -> None:
    """Act on a record of Blender's."""
    stage, message = str(record["stage"]), str(record.get("message", ""))
    if stage == RENDERED_STAGE:
        _publish(waiting, listener)
    elif record.get("warning"):
        if listener.warn:
            listener.warn(message)
    elif listener.progress and stage not in LAST_STAGES:
        listener.progress(stage, float(record.get("fraction", 0)), message)


def _publish(waiting: _Waiting, listener: Listener) -> None:
    """Publish the first of the ``waiting`` jobs."""
    job, staging = waiting.pop(0)
    publish(staging / "frame", Path(job.output), DERIVED_FILES)
    release(staging)  # whoever is told of the render may finish it
    if waiting:  # the last staging folder has the log
        remove(staging)
    listener.rendered(job)
