"""Render a scene into a file, whole or not at all."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, lock_file
from lfsr_core.images import exr

from .. import compat
from ..scene.overrides import overridden
from .progress import Progress, following

# Files and folders that a render is writing now; a process that must end at once removes them.
UNFINISHED: set[Path] = set()


def render_to(scene: bpy.types.Scene, path: str | Path, progress: Progress | None = None) -> float:
    """Render the scene as it is set up now into ``path``, whole or not at all, and return the seconds."""
    started = time.perf_counter()
    with unfinished(path) as temporary, overridden(scene.render, {"filepath": compat.literal_path(str(temporary))}):
        try:
            with following(progress):
                bpy.ops.render.render(write_still=True, scene=scene.name)
        except RuntimeError as error:
            raise LfsrError(f"Blender cannot render this scene ({str(error).strip()}): see its messages") from None
        if not temporary.is_file():
            raise LfsrError(f"Blender wrote no image for {path}: see its messages")
        exr.check_complete(temporary)
    return time.perf_counter() - started


@contextmanager
def unfinished(path: str | Path) -> Iterator[Path]:
    """As ``atomic_path``; the temporary file and its lock are listed in UNFINISHED inside the block."""
    with atomic_path(path) as temporary, listed(temporary), listed(lock_file(temporary)):
        yield temporary


@contextmanager
def listed(path: Path) -> Iterator[None]:
    """List ``path`` in UNFINISHED inside the block."""
    UNFINISHED.add(path)
    try:
        yield
    finally:
        UNFINISHED.discard(path)
