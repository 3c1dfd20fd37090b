"""How far Cycles is, and a way to stop it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy

Progress = Callable[[float, str], None]

_SAMPLES = re.compile(r"(?:Rendered (\d+)/(\d+) Tiles, )?Sample (\d+)/(\d+)")


@contextmanager
def following(progress: Progress | None) -> Iterator[None]:
    """Call ``progress(fraction, message)`` while Cycles renders inside the block.

    An exception it raises cancels: Cycles cannot be stopped from Python and ends
    its image first, then the exception leaves the block. A KeyboardInterrupt that
    Blender swallows on the way would be lost otherwise.
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

    bpy.app.handlers.render_stats.append(follow)
    try:
        yield
    finally:
        bpy.app.handlers.render_stats.remove(follow)
    if stopped:
        raise stopped[0]


def doing(statistics: str) -> str:
    """What Cycles does, from its statistics line: samples, or how it makes the scene ready."""
    parts = [part.strip() for part in statistics.split("|")]
    return ": ".join(part for part in parts if not part.startswith(("Mem:", "Remaining:", "Time:", "Fra:", "Peak:")))


def sample_fraction(statistics: str) -> float | None:
    """Share of the image that is done, from Cycles' statistics line; None where it is of something else."""
    found = _SAMPLES.search(statistics)
    if found is None:
        return None
    tile, tiles = int(found[1] or 0), int(found[2] or 1)
    return min(1.0, (tile + int(found[3]) / max(1, int(found[4]))) / tiles)


def part(progress: Progress | None, index: int, count: int) -> Progress | None:
    """Progress of part ``index`` of ``count`` equal parts, as progress of the whole."""
    if progress is None or count == 1:
        return progress
    return lambda fraction, message: progress((index + fraction) / count, f"{index + 1}/{count}: {message}")


def share(progress: Progress | None, before: int, size: int, count: int) -> Progress | None:
    """Progress of ``size`` of ``count`` rows, with ``before`` done already, as progress of the whole."""
    if progress is None:
        return None
    return lambda fraction, message: progress((before + fraction * size) / count, message)
