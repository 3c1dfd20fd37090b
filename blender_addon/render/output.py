"""Render a scene into a file, whole or not at all, and follow Cycles' progress."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, lock_file
from lfsr_core.images import exr

from .. import compat
from ..scene.overrides import overridden

# Called with the fraction of an image that is done and what Cycles does; an exception that it raises cancels.
Follow = Callable[[float, str], None]
# Files and folders that a render is writing now; a process that must end at once removes them.
UNFINISHED: set[Path] = set()
_SAMPLES = re.compile(r"(?:Rendered (\d+)/(\d+) Tiles, )?Sample (\d+)/(\d+)")


def render_to(scene: bpy.types.Scene, path: str | Path, follow: Follow | None = None) -> float:
    """Render the scene as it is set up now into ``path``, whole or not at all, and return the seconds.

    Python cannot stop Cycles: after an exception of ``follow`` it ends its image first, then that leaves this
    function, even a KeyboardInterrupt that Blender would swallow.
    """
    started, stopped, last = time.perf_counter(), list[BaseException](), (0.0, "")

    def listen(statistics: str, *_: object) -> None:
        nonlocal last
        before, fraction = last, sample_fraction(statistics)
        last = before[0] if fraction is None else fraction, doing(statistics)
        if follow and not stopped and last[1] != before[1]:
            try:
                follow(*last)
            except BaseException as error:
                stopped.append(error)

    with unfinished(path) as temporary, overridden(scene.render, {"filepath": compat.literal_path(str(temporary))}):
        try:
            with heard(listen):
                bpy.ops.render.render(write_still=True, scene=scene.name)
        except RuntimeError as error:
            raise LfsrError(f"Blender cannot render this scene ({str(error).strip()}): see its messages") from None
        if stopped:
            raise stopped[0]
        if not temporary.is_file():
            raise LfsrError(f"Blender wrote no image for {path}: see its messages")
        exr.check_complete(temporary)
    return time.perf_counter() - started


@contextmanager
def heard(listener: Callable[..., None]) -> Iterator[None]:
    """Call ``listener`` with each of Cycles' statistics lines, and more, inside the block."""
    bpy.app.handlers.render_stats.append(listener)
    try:
        yield
    finally:
        bpy.app.handlers.render_stats.remove(listener)


def doing(statistics: str) -> str:
    """Return what Cycles does (renders samples, or prepares the scene) from its statistics line."""
    parts = [part.strip() for part in statistics.split("|")]
    return ": ".join(part for part in parts if not part.startswith(("Mem:", "Remaining:", "Time:", "Fra:", "Peak:")))


def sample_fraction(statistics: str) -> float | None:
    """Return the fraction of the image that is done from Cycles' statistics line, None if the line has none."""
    numbers = _SAMPLES.search(statistics)
    if numbers is None:
        return None
    tile, tiles = int(numbers[1] or 0), int(numbers[2] or 1)
    return min(1.0, (tile + int(numbers[3]) / max(1, int(numbers[4]))) / tiles)


def part_of(follow: Follow | None, first: int, size: int, count: int, prefix: str = "") -> Follow | None:
    """Return what follows ``size`` steps from ``first`` (counted from 0) as a part of all ``count`` steps."""
    return follow and (lambda fraction, message: follow((first + fraction * size) / count, prefix + message))


def one_of(follow: Follow | None, index: int, count: int) -> Follow | None:
    """Return what follows image ``index`` (from 0) of ``count`` images, numbered in its messages."""
    return part_of(follow, index, 1, count, f"{index + 1}/{count}: " if count > 1 else "")


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
