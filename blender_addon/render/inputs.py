"""Digest what decides the pixels of a render: its cached parts are used by the same render only."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import bpy

from lfsr_core.base.files import file_digest, file_stamp
from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import Frame
from lfsr_core.frames.identity import PLACES, digest, request_facts
from lfsr_core.frames.request import AUTO, Request
from lfsr_core.version import __version__

from ..scene.notices import image_files

HERE = Path(__file__).resolve().parent
# Fields of a job that the scene or this machine may settle. The panel renders copies of its file, whatever their path.
SETTLED = ("scene", "device", "light", "sampling")
SOURCES = ("render", "scene")  # packages whose modules decide pixels


@dataclasses.dataclass(frozen=True)
class Opened:
    """How the scene was opened."""

    seconds: float = 0.0  # it took
    content: str = ""  # stamp of its file; empty if it is not known
    light: str = AUTO  # in which it is rendered, AUTO where that is not settled
    notes: tuple[str, ...] = ()  # what the user was told of it


def inputs_before_opening(job: Request, content: str) -> dict[str, str]:
    """Return those of the ``inputs`` that do not need the scene."""
    settings = request_facts(job, (*PLACES, *SETTLED))
    sources = (path for name in SOURCES for path in sorted((HERE.parent / name).rglob("*.*"))
               if path.suffix in (".py", ".osl"))
    program = [__version__, *map(file_digest, sources)]
    chosen = {} if job.sampling.scales else {"samples or scale": digest([job.sampling.scale, job.sampling.samples])}
    return {"settings": digest(settings), **chosen, "scene file": digest(content),
            "Blender": digest([bpy.app.version_string, str(bpy.app.build_hash)]), "version of LFSR": digest(program)}


def inputs(scene: bpy.types.Scene, job: Request, frame: Frame, content: str) -> dict[str, str]:
    """Return a digest of each kind of input, by a name for messages; ``content``: stamp of the scene's file."""
    resolved = to_data(dataclasses.replace(frame, seconds={}, gpus=()))
    resolved |= {"scene": scene.name, "file": frame.scene, "scripts": bpy.app.autoexec_fail, "light": job.light}
    files = {*map(Path, bpy.utils.blend_paths(absolute=True, packed=False, local=False)), *image_files()}
    return inputs_before_opening(job, content) | {
        "samples or scale": digest([frame.scale, frame.samples]), "device, light or camera": digest(resolved),
        "images or linked files": digest([[str(path), file_stamp(path)] for path in sorted(files)])}
