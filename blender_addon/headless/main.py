"""Runs one job inside Blender, a render or the encoding of a film; its progress goes to standard output."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.files import system_errors
from lfsr_core.frames.job import Job, read_job
from lfsr_core.render.content import scene_content, stamp
from lfsr_core.render.protocol import EXIT_BAD_INPUT, EXIT_CANCELLED, emit

from ..array.cameras import choice_notice, choose_camera
from ..render.frame_folder import render_job
from ..render.inputs import Opened
from ..scene.notices import notices
from ..scene.open import choose_scene, open_scene
from . import encode, stopping


def main(arguments: Sequence[str]) -> int:
    """Run the job file named in ``arguments``, or ``encode`` what follows; the process's exit code."""
    stopping.on_signals(_stop)
    try:
        if len(arguments) != (3 if arguments[:1] == [encode.NAME] else 1):
            raise LfsrError(f"expected one argument, the job file, and got {len(arguments)}")
        with system_errors():
            folder = encode.run(arguments[1:]) if len(arguments) == 3 else run(read_job(arguments[0]))
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    emit(stage="done", folder=str(folder))
    return 0


def run(job: Job) -> Path:
    """Open the job's scene if it names one, render it, and return the frame folder."""
    started = time.perf_counter()
    emit(stage="open", fraction=0.0, message=job.scene or "the open scene")
    scene, content = _open(job)
    if job.scene_name is not None:
        scene = choose_scene(job.scene_name)
    if job.camera is not None:
        choose_camera(scene, job.camera)
    elif not job.scene.endswith(".blend") and scene.camera is not None and job.scene:
        warn(choice_notice(scene))
    for sentence in notices(scene):
        warn(sentence)
    opened = Opened(time.perf_counter() - started, content)
    return render_job(scene, job, opened, progress=_progress, warn=warn)


def _open(job: Job) -> tuple[bpy.types.Scene, str]:
    """The job's scene and the content of its file, where something is to be kept and the file did not change."""
    if not job.scene:
        return bpy.context.scene, ""
    file = Path(job.scene)
    before = stamp(file)
    scene = open_scene(job.scene)
    content = scene_content(file) if job.parts else ""
    return scene, content if stamp(file) == before else ""


def warn(message: str) -> None:
    """Something the user should know that does not stop the render."""
    emit(stage="render", fraction=0.0, message=message, warning=True)


def _progress(fraction: float, message: str = "") -> None:
    emit(stage="render", fraction=round(fraction, 4), message=message)


def _stop() -> None:
    try:
        emit(stage="cancelled", message="stopped by a signal")
    finally:  # also where nobody listens any more and writing fails
        os._exit(EXIT_CANCELLED)


def script_arguments() -> list[str]:
    """Arguments meant for the script: those after ``--`` under Blender, else all."""
    return sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
