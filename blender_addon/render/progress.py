"""Follow Cycles' progress, and cancel a render."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy

Progress = Callable[[float, str], None]

_SAMPLES = re.compile(r"(?:Rendered (\d+)/(\d+) Tiles, )?Sample (\d+)/(\d+)")


@contextmanager
def heard(listener: Callable[..., None]) -> Iterator[None]:
    """Call ``listener`` with each of Cycles' statistics lines, and more, inside the block."""
    bpy.app.handlers.render_stats.append(listener)
    try:
        yield
    finally:
        bpy.app.handlers.render_stats.remove(listener)


@contextmanager
def following(progress: Progress | None) -> Iterator[None]:
    """Call ``progress(fraction, message)`` while Cycles renders inside the block.

    An exception from ``progress`` cancels. Python cannot stop Cycles: it ends its image first, then the
    exception leaves the block, even a KeyboardInterrupt that Blender would swallow.
    """
    if progress is None:
        yield
        return
    stopped: list[BaseException] = []
    done, said = 0.0, ""

    def follow(statistics: str, *_: object) -> None:
        nonlocal done, said
        fraction, before = sample_fraction(statistics), said
        done, said = done if fraction is None else fraction, doing(statistics)
        if stopped or said == before:
            return
        try:
            progress(done, said)
        except BaseException as error:
            stopped.append(error)

    with heard(follow):
        yield
    if stopped:
        raise stopped[0]


def doing(statistics: str) -> str:
    """Return what Cycles does (renders samples, or prepares the scene) from its statistics line."""
    parts = [part.strip() for part in statistics.split("|")]
    return ": ".join(part for part in parts if not part.startswith(("Mem:", "Remaining:", "Time:", "Fra:", "Peak:")))


def sample_fraction(statistics: str) -> float | None:
    """Return the fraction of the image that is done from Cycles' statistics line, None if the line has none."""
    found = _SAMPLES.search(statistics)
    if found is None:
        return None
    tile, tiles = int(found[1] or 0), int(found[2] or 1)
    return min(1.0, (tile + int(found[3]) / max(1, int(found[4]))) / tiles)


def part(progress: Progress | None, first: int, size: int, count: int, prefix: str = "") -> Progress | None:
    """Progress of ``size`` steps from ``first`` (counted from 0), as progress of all ``count`` steps."""
    if progress is None:
        return None
    return lambda fraction, message: progress((first + fraction * size) / count, prefix + message)


def one_of(progress: Progress | None, index: int, count: int) -> Progress | None:
    """Progress of image ``index`` (from 0) of ``count`` images, numbered in its messages."""
    return part(progress, index, 1, count, f"{index + 1}/{count}: " if count > 1 else "")
