"""Blender as a separate process: run one job, pass its progress on."""

from __future__ import annotations

import collections
import dataclasses
import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, check_name, system_errors
from lfsr_core.frames import frame
from lfsr_core.frames.job import Job
from lfsr_core.progress import Progress
from lfsr_core.records import write_record
from lfsr_core.render.blender import Blender
from lfsr_core.render.parts_folder import kept_sentence, parts_folder
from lfsr_core.render.protocol import ENDS_WITH_INPUT, EXIT_BAD_INPUT, LAST_STAGES, parse_progress
from lfsr_core.render.staging import publish, staging_folder

LOG_FILE = "blender.log"
SECONDS_TO_STOP = 5
LINES_IN_MESSAGE, MOST_LAST_WORDS = 3, 120
RENDERED_FILES = {"render": (frame.LOW_RES_FILE,), "reference": frame.REFERENCE_FILES}
# Made from an older render of the same folder, so they would no longer match it.
DERIVED_FILES = (frame.EIA_FILE, frame.EIA_LINEAR_FILE, frame.PANEL_FILE, frame.MASK_FILE, frame.REPORT_FILE,
                 frame.VIEWER_FILE, LOG_FILE)
Warn = Callable[[str], None]


def run_job(job: Job, blender: Blender, progress: Progress | None = None, warn: Warn | None = None) -> None:
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
    folder = Path(job.output)
    check_folder(folder, job.kind)
    parts = parts_folder(folder).resolve()
    with staging_folder(folder) as staging, _told(parts, warn), system_errors():
        staged = staging / "frame"
        staged.mkdir()
        job_file, log_file = staging / "job.json", staging / LOG_FILE
        write_record(job_file, dataclasses.replace(job, output=str(staged.resolve()), parts=str(parts)))
        _run(blender.command(job_file), log_file, folder, _listener(progress, warn))
        publish(staged, folder, DERIVED_FILES)


@contextmanager
def _told(parts: Path, warn: Warn | None) -> Iterator[None]:
    """Whatever ends the block early, ``warn`` of what is kept."""
    try:
        yield
    except BaseException:
        if warn and (sentence := kept_sentence(parts)):
            warn(sentence)
        raise


def check_folder(folder: Path, kind: str) -> None:
    """LfsrError if ``folder`` is a file or holds another kind of render, which must not be lost."""
    check_name(folder)
    if folder.exists() and not folder.is_dir():
        raise LfsrError(f"{folder} is a file, but the output must be a folder: choose another name")
    for other, files in RENDERED_FILES.items():
        if other != kind and any((folder / name).exists() for name in files):
            raise LfsrError(f"{folder} already holds a {other}, but a {kind} was asked for: choose another folder")


def _listener(progress: Progress | None, warn: Warn | None) -> Callable[[dict[str, Any]], None]:
    """What to do with one LFSR record."""
    def listen(record: dict[str, Any]) -> None:
        stage, message = str(record["stage"]), str(record.get("message", ""))
        if record.get("warning"):
            if warn:
                warn(message)
        elif progress and stage not in LAST_STAGES:
            progress(stage, float(record.get("fraction", 0)), message)
    return listen


def _run(command: list[str], log_file: Path, folder: Path, listen: Callable[[dict[str, Any]], None]) -> None:
    # Its own process group: Ctrl-C reaches this program only, which then stops Blender.
    # A pipe for its input, which ends with this program, whatever ends that; then Blender ends too.
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             text=True, errors="replace", start_new_session=True,
                             env=os.environ | {"PYTHONUNBUFFERED": "1", ENDS_WITH_INPUT: "1"})
    with child, log_file.open("w", encoding="utf-8") as log:
        try:
            last = _follow(child.stdout or (), log.write, listen)
            code = child.wait()
        except BaseException:
            _stop(child)
            raise
    if code == EXIT_BAD_INPUT and last.get("stage") == "error":
        raise LfsrError(str(last.get("message")))
    if code != 0 or last.get("stage") != "done":
        raise _crash(code, log_file, folder)


def _follow(lines: Iterable[str], log: Callable[[str], Any],
            listen: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Log every line, pass LFSR records on; returns the last one."""
    last: dict[str, Any] = {}
    for line in lines:
        log(line)
        record = parse_progress(line)
        if record is not None:
            last = record
            listen(record)
    return last


def _stop(child: subprocess.Popen[str]) -> None:
    if child.poll() is not None:
        return
    os.killpg(child.pid, signal.SIGTERM)
    try:
        child.wait(SECONDS_TO_STOP)
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)


def _crash(code: int, log_file: Path, folder: Path) -> LfsrError:
    kept = folder / LOG_FILE
    with atomic_path(kept) as temporary:
        shutil.copyfile(log_file, temporary)
    with kept.open(encoding="utf-8", errors="replace") as log:
        lines = collections.deque((line.strip() for line in log if line.strip()), maxlen=LINES_IN_MESSAGE)
    reason = f"signal {-code}" if code < 0 else f"exit code {code}"
    last = (" / ".join(lines) or "nothing")[-MOST_LAST_WORDS:]
    return LfsrError(f"Blender stopped with {reason} before the render was done, last saying {last!r}: "
                     f"the whole log is {kept}")
