"""Digest what decides the pixels of a render: its cached parts are used by the same render only."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import bpy

from lfsr_core.frames.frame import Frame
from lfsr_core.frames.identity import digest, job_facts
from lfsr_core.frames.job import AUTO, Job
from lfsr_core.records import to_data
from lfsr_core.render.content import file_content, stamp
from lfsr_core.version import __version__

from ..scene.notices import image_files

HERE = Path(__file__).resolve().parent
SOURCES = ("array", "render", "scene")  # packages whose modules decide pixels


@dataclasses.dataclass(frozen=True)
class Opened:
    """How the scene was opened."""

    seconds: float = 0.0  # it took
    content: str = ""  # digest of its file, see ``lfsr_core.render.content``; empty if it is not known
    light: str = AUTO  # in which it is rendered, AUTO where that is not settled
    notes: tuple[str, ...] = ()  # what the user was told of it


def inputs(scene: bpy.types.Scene, job: Job, frame: Frame, content: str) -> dict[str, str]:
    """Return a digest of each kind of input, by a name for messages; ``content``: digest of the scene's file."""
    settings = job_facts(job) | to_data(dataclasses.replace(frame, seconds={}))
    # The panel renders copies of its file: their content counts, not their path.
    settings |= {"scene": scene.name, "file": frame.scene, "scripts": bpy.app.autoexec_fail}
    files = {*map(Path, bpy.utils.blend_paths(absolute=True, packed=False, local=False)), *image_files()}
    program = [__version__, *(file_content(path) for name in SOURCES
                              for path in sorted(HERE.with_name(name).iterdir()) if path.is_file())]
    return {"settings": digest(settings), "scene file": digest(content),
            "images or linked files": digest([[str(path), stamp(path)] for path in sorted(files)]),
            "Blender": digest([bpy.app.version_string, str(bpy.app.build_hash)]), "version of LFSR": digest(program)}
