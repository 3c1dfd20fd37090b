"""An animation on several workers: a task is a few neighbouring frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.pipeline.animation import DONE, Animation, state
from lfsr_core.pipeline.cluster import Cluster, Task, work_through
from lfsr_core.pipeline.engine import Result, Tools, render_animation


def render_on(cluster: Cluster, animation: Animation, tools: Tools) -> list[Result]:
    """Render an animation as ``engine.render_animation`` does, on a cluster.

    LfsrError also as of ``cluster.work_through``, and with temporal averaging.
    """
    if animation.second.temporal_averaging:
        raise LfsrError("--temporal-averaging was given, but each of several workers knows its own frames only: leave "
                        "out the workers, or --temporal-averaging")
    quiet = Tools(tools.blender, chunk=tools.chunk, overwrite=tools.overwrite)
    results: dict[str, Result] = {}

    def tasks(workers: int) -> Iterator[Task]:
        for chunk in _chunks(animation, tools, workers):
            yield Task(str(chunk.jobs[0].frame), render_animation, (chunk, quiet))

    def took(made: list[Result]) -> None:
        results.update((result.folder, result) for result in made)
        tools.progress("frames", len(results) / len(animation.jobs), f"{len(results)} of {len(animation.jobs)}")

    first = animation.jobs[0]
    work_through(cluster, Path(first.output).parent, first.scene, tasks, took)
    return [results[job.output] for job in animation.jobs]


def _chunks(animation: Animation, tools: Tools, workers: int) -> Iterator[Animation]:
    """Yield neighbouring frames, as many as one Blender takes, and so few that every worker has some.

    Frames that are done come last and together, since they cost nothing.
    """
    done = [] if tools.overwrite else [job for job in animation.jobs if state(animation, job) == DONE]
    waiting = [job for job in animation.jobs if job not in done]
    size = max(1, min(tools.chunk, -(-len(waiting) // (2 * workers))))
    for first in range(0, len(waiting), size):
        yield dataclasses.replace(animation, jobs=tuple(waiting[first:first + size]))
    if done:
        yield dataclasses.replace(animation, jobs=tuple(done))
