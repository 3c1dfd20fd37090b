"""Run jobs inside Blender, renders or the encoding of a film, with their progress on standard output."""

from __future__ import annotations

import dataclasses
import functools
import os
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import file_stamp, system_errors
from lfsr_core.frames.identity import PLACES, digest, request_facts, scene_stamp
from lfsr_core.frames.request import Request, read_request
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.pipeline.parts import remove_others
from lfsr_core.process.protocol import (
    EXIT_BAD_INPUT,
    EXIT_CANCELLED,
    RENDERED_STAGE,
    emit,
    emit_last,
    emit_progress,
    emit_warning,
    repeated,
)

from ..render.frame_folder import render_job, settled_light
from ..render.inputs import Opened, inputs_before_opening
from ..scene.array import scale
from ..scene.array.cameras import camera_notices, choose_camera
from ..scene.notices import notices
from ..scene.open import choose_scene, local_scene, open_scene
from ..scene.overrides import overridden
from . import encode, stopping


def main(arguments: Sequence[str]) -> int:
    """Run the job files named in ``arguments``, ``encode FRAMES FILE`` or ``scale JOB``; return the exit code."""
    stopping.with_input(_stop)
    try:
        with system_errors(), repeated():
            result = _run(arguments)
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    emit(stage="done", **result)
    return 0


def _run(arguments: Sequence[str]) -> dict[str, object]:
    match arguments:
        case [encode.NAME, frames, film, rate]:
            return {"folder": str(encode.run(frames, film, rate))}
        case [scale.CHOOSE, path]:
            job = read_request(path)
            return dataclasses.asdict(scale.scale_of(_chosen_scene(job), job))
        case [scale.LOOK, path]:
            job = read_request(path)
            return {"moves": scale.all_moves(_chosen_scene(job), job).tolist()}
        case [] | [encode.NAME | scale.CHOOSE | scale.LOOK, *_]:
            raise LfsrError("expected job files, encode, two paths and a rate, or scale or depth and a job file, but "
                            f"got {len(arguments)} arguments")
    return {"folder": str(run_all([read_request(path) for path in arguments]))}


def run_all(jobs: Sequence[Request]) -> Path:
    """Render ``jobs``, opening a scene where it differs from the job before; return the last frame folder."""
    scene, opened, last, progress = None, Opened(), None, functools.partial(emit_progress, "render")
    choices: dict[str, ScaleChoice] = {}
    with ExitStack() as stack:
        for job in jobs:
            if last is None or (job.scene, job.scene_name) != (last.scene, last.scene_name):
                stack.close()
                scene, opened = _opened(job)
                if len(jobs) > 1:
                    # Without it Cycles would build the scene again for each frame.
                    stack.enter_context(overridden(scene.render, {"use_persistent_data": True}))
            last, job = job, _of_one_scale(scene, job, choices)
            folder = render_job(scene, job, opened, progress=progress, warn=emit_warning)
            opened = dataclasses.replace(opened, seconds=0.0)
            if len(jobs) > 1:
                emit(stage=RENDERED_STAGE, folder=str(folder))
    return folder


def _of_one_scale(scene: bpy.types.Scene, job: Request, choices: dict[str, ScaleChoice]) -> Request:
    """The job at the scale of its animation; ``choices``: those made before, so that frames are looked at once."""
    if not job.sampling.scales or not job.sampling.frames:
        return job
    question = digest(request_facts(job, (*PLACES, "frame", "seed")))
    if question not in choices:
        choices[question] = scale.scale_of(scene, job)
    return job.with_scale(choices[question])


def _opened(job: Request) -> tuple[bpy.types.Scene, Opened]:
    """The job's scene, as of ``_chosen_scene``, and how it was opened."""
    started = time.perf_counter()
    before = file_stamp(Path(job.scene))
    content = _content(job)
    emit(stage="open", fraction=0.0, message=job.scene or "the open scene")
    scene = _chosen_scene(job)
    if file_stamp(Path(job.scene)) != before:
        content = ""
    is_imported = bool(job.scene) and not job.scene.endswith(".blend")
    seconds, notes = time.perf_counter() - started, list[str]()

    def note(sentence: str) -> None:
        notes.append(sentence)
        emit_warning(sentence)

    for sentence in (*notices(scene), *camera_notices(scene, job.camera, is_imported)):
        note(sentence)
    light = settled_light(scene, job, note)
    return scene, Opened(seconds, content, light, tuple(notes))


def _chosen_scene(job: Request) -> bpy.types.Scene:
    """The job's scene, opened if the job names a file, with its camera chosen."""
    scene = open_scene(job.scene) if job.scene else bpy.context.scene
    if job.scene_name is not None:
        scene = choose_scene(job.scene_name)
    scene = local_scene(scene)
    if job.camera is not None:
        choose_camera(scene, job.camera)
    return scene


def _content(job: Request) -> str:
    """Stamp of the job's file, "" if nothing is to be cached. Cached parts that cannot be used are removed."""
    if not job.parts or not Path(job.scene).is_file():
        return ""
    content = scene_stamp(job.scene)
    if sentence := remove_others(Path(job.parts), inputs_before_opening(job, content)):
        emit_warning(sentence)
    return content


def _stop() -> None:
    try:
        emit_last(stage="cancelled", message="stopped")
    finally:  # also if writing fails because nobody listens any more
        os._exit(EXIT_CANCELLED)
