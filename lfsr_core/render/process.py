"""Blender as a separate process: run one job, pass its progress on."""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, check_name, system_errors
from lfsr_core.frames import frame
from lfsr_core.frames.job import Job
from lfsr_core.progress import Progress
from lfsr_core.records import write_record
from lfsr_core.render.blender import Starts
from lfsr_core.render.child import Child
from lfsr_core.render.parts_folder import kept_sentence, parts_folder
from lfsr_core.render.protocol import LAST_STAGES, RENDERED_STAGE
from lfsr_core.render.staging import publish, staging_folder

LOG_FILE = "blender.log"
RENDERED_FILES = {"render": (frame.LOW_RES_FILE,), "reference": frame.REFERENCE_FILES}
# Made from an older render of the same folder, so they would no longer match it.
DERIVED_FILES = (frame.EIA_FILE, frame.EIA_LINEAR_FILE, frame.PANEL_FILE, frame.MASK_FILE, frame.REPORT_FILE,
                 frame.VIEWER_FILE, frame.WORLD_FILE, LOG_FILE)
Warn = Callable[[str], None]


def run_job(job: Job, blender: Starts, progress: Progress | None = None, warn: Warn | None = None) -> None:
    """Render ``job`` and put what it wrote into its folder, all of it or nothing.

    Of a long render that ends early the parts that are whole are kept, and the same job goes on from them.

    Parameters
    ----------
    job : what to render and where to
    blender : the Blender to render it with
    progress : called with (stage, fraction, message) while it runs
    warn : called with a sentence that the user should know although it does not stop the render

    Raises
    ------
    LfsrError : with Blender's own sentence after bad input, or with the last lines of its log (kept in that folder)
        after a crash
    KeyboardInterrupt : once Blender is stopped
    """
    run_jobs([job], blender, Listener(progress, warn))


def _nothing(_job: Job) -> None:
    pass


@dataclasses.dataclass(frozen=True)
class Listener:
    """Who wants to know how renders go."""

    progress: Progress | None = None  # called with (stage, fraction, message)
    warn: Warn | None = None  # called with a sentence that the user should know
    rendered: Callable[[Job], None] = _nothing  # called with each job whose folder is complete


def run_jobs(jobs: Sequence[Job], blender: Starts, listener: Listener) -> None:
    """Render ``jobs`` one after the other in one Blender, which keeps the scene open between those of one file.

    Each folder is published as soon as it is rendered. Errors as of ``run_job``, about the first job that is not.
    """
    for job in jobs:
        check_folder(Path(job.output), job.kind)
    with contextlib.ExitStack() as stack:
        chunk = _Chunk([_Staged(job, stack.enter_context(staging_folder(Path(job.output)))) for job in jobs], listener)
        stack.enter_context(_told(chunk))
        stack.enter_context(system_errors())
        files = [staged.write() for staged in chunk.staged]
        _run(blender.command(*files), chunk)
        while chunk.waiting:  # of a Blender that does not say when one of several is rendered
            chunk.publish()


@dataclasses.dataclass(frozen=True)
class _Staged:
    """A job and the hidden folder in which it is made."""

    job: Job
    staging: Path

    @property
    def frame(self) -> Path:
        """Frame folder that Blender fills."""
        return self.staging / "frame"

    @property
    def folder(self) -> Path:
        """Where it is published to."""
        return Path(self.job.output)

    @property
    def parts(self) -> Path:
        """Where parts of a long render are kept."""
        return parts_folder(self.folder).resolve()

    def write(self) -> Path:
        """The file that tells Blender what to do."""
        self.frame.mkdir()
        path = self.staging / "job.json"
        write_record(path, dataclasses.replace(self.job, output=str(self.frame.resolve()), parts=str(self.parts)))
        return path


class _Chunk:
    """Jobs of one Blender."""

    def __init__(self, staged: list[_Staged], listener: Listener) -> None:
        self.staged, self.listener = staged, listener
        self.waiting = list(staged)
        self.log_file = staged[-1].staging / LOG_FILE

    @property
    def current(self) -> _Staged:
        """The one in work."""
        return self.waiting[0] if self.waiting else self.staged[-1]

    def publish(self) -> None:
        """The one in work is whole."""
        done = self.waiting.pop(0)
        publish(done.frame, done.folder, DERIVED_FILES)
        if self.waiting:  # nobody would look for what a dead run left beside a finished frame
            shutil.rmtree(done.staging)
        self.listener.rendered(done.job)

    def listen(self, record: dict[str, Any]) -> None:
        """Do what an LFSR record asks for."""
        stage, message = str(record["stage"]), str(record.get("message", ""))
        if stage == RENDERED_STAGE:
            self.publish()
        elif record.get("warning"):
            if self.listener.warn:
                self.listener.warn(message)
        elif self.listener.progress and stage not in LAST_STAGES:
            self.listener.progress(stage, float(record.get("fraction", 0)), message)


@contextmanager
def _told(chunk: _Chunk) -> Iterator[None]:
    """Whatever ends the block early, warn of what is kept."""
    try:
        yield
    except BaseException:
        if chunk.listener.warn and (sentence := kept_sentence(chunk.current.parts)):
            chunk.listener.warn(sentence)
        raise


def check_folder(folder: Path, kind: str) -> None:
    """LfsrError if ``folder`` is a file or holds another kind of render, which must not be lost."""
    check_name(folder)
    if folder.exists() and not folder.is_dir():
        raise LfsrError(f"{folder} is a file, but the output must be a folder: choose another name")
    for other, files in RENDERED_FILES.items():
        if other != kind and any((folder / name).exists() for name in files):
            raise LfsrError(f"{folder} already holds a {other}, but a {kind} was asked for: choose another folder")


def _run(command: list[str], chunk: _Chunk) -> None:
    with chunk.log_file.open("w", encoding="utf-8") as log, Child(command, log=log.write) as child:
        for record in child.records():
            chunk.listen(record)
        if not child.is_done():
            kept = chunk.current.folder / LOG_FILE
            with atomic_path(kept) as temporary:
                log.flush()
                shutil.copyfile(chunk.log_file, temporary)
            raise child.crash("Blender stopped with", f"the whole log is {kept}")
