"""A shot on several workers: a task is a few frames that follow each other, as ``engine.render_shot`` makes them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.sequence.cluster import Cluster, Piece, Site, work_through
from lfsr_core.sequence.engine import Result, Tools, render_shot
from lfsr_core.sequence.shot import DONE, Shot, state


def render_on(cluster: Cluster, shot: Shot, tools: Tools) -> list[Result]:
    """As ``engine.render_shot``, on a cluster; errors also as of ``cluster.work_through``, and where frames share."""
    if shot.second.temporal_averaging:
        raise LfsrError("--temporal-averaging was given, but each of several workers knows its own frames only: leave "
                        "out the workers, or --temporal-averaging")
    quiet = Tools(tools.blender, chunk=tools.chunk, overwrite=tools.overwrite)
    site = Site(Path(shot.jobs[0].output).parent, shot.jobs[0].scene)
    results: dict[str, Result] = {}

    def pieces(workers: int) -> Iterator[Piece]:
        return (Piece(str(chunk.jobs[0].frame), render_shot, (chunk, quiet)) for chunk in _chunks(shot, tools, workers))

    def took(made: list[Result]) -> None:
        results.update((result.folder, result) for result in made)
        tools.progress("frames", len(results) / len(shot.jobs), f"{len(results)} of {len(shot.jobs)}")

    work_through(cluster, site, pieces, took)
    return [results[job.output] for job in shot.jobs]


def _chunks(shot: Shot, tools: Tools, workers: int) -> Iterator[Shot]:
    """Neighbouring frames together, as many as one Blender takes, and few enough that all workers have some.

    Frames that are done go last and together, since they cost nothing.
    """
    done = [] if tools.overwrite else [job for job in shot.jobs if state(shot, job) == DONE]
    waiting = [job for job in shot.jobs if job not in done]
    size = max(1, min(tools.chunk, -(-len(waiting) // (2 * workers))))
    for first in range(0, len(waiting), size):
        yield dataclasses.replace(shot, jobs=tuple(waiting[first:first + size]))
    if done:
        yield dataclasses.replace(shot, jobs=tuple(done))
