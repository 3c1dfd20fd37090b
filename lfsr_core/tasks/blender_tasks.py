"""Tasks of the add-on that start renders in Blender; each returns JSON-ready data."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.base.records import from_data, to_data
from lfsr_core.frames.request import Request
from lfsr_core.plan.candidates import Candidate
from lfsr_core.process.protocol import emit_progress, emit_warning

if TYPE_CHECKING:
    from lfsr_core.pipeline.animation import Animation
    from lfsr_core.pipeline.engine import Result


@dataclasses.dataclass(frozen=True)
class RenderCommand:
    """Command of the add-on that starts Blender; a ``render.blender.Starts``."""

    words: tuple[str, ...]

    def command(self, *job_files: Path) -> list[str]:
        """Command line that runs ``job_files``."""
        return [*self.words, *map(str, job_files)]


@dataclasses.dataclass(frozen=True)
class Found:
    """Result of a plan, for the panel."""

    sentence: str
    chosen: Candidate | None  # the cheapest that reaches the target, None if there is none


def plan(job: dict[str, Any], options: dict[str, Any], command: list[str], work: str) -> dict[str, Any]:
    """Plan for the scene of a job, with ``PlanOptions``; return data of a ``Found``.

    ``command``: words that start a render, before the job file; ``work``: folder for the sample.
    """
    from lfsr_core.pipeline.rendering import run_job
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import make_plan
    from lfsr_core.plan.report import sentence

    wanted, blender = from_data(PlanOptions, options, "options of the plan"), RenderCommand(tuple(command))
    choice = make_plan(from_data(Request, job, "job of the plan"), wanted,
                       lambda job, progress: run_job(job, blender, progress, emit_warning), work, emit_progress).choice
    found: dict[str, Any] = to_data(Found(sentence(choice, wanted), choice.chosen.candidate if choice.chosen else None))
    return found


def animation(job: dict[str, Any], frames: list[int], second: dict[str, Any], command: list[str],
              overwrite: bool = False) -> dict[str, Any]:
    """Render and finish the frames of an animation that are not finished yet.

    Frames of other settings are rendered again, since the panel shows what is wanted. Frames of a scene that has
    changed stay, with a warning, since a file changes with every click.

    ``job``: its output is the folder of the frames' folders; ``second``: data of a ``sequence.animation.SecondStage``;
    ``command``: words that start a render, before the job files; ``overwrite``: render finished frames again.

    Returns
    -------
    "table", a line per frame; "sentence", the outcome; "failed", the first failed frame's sentence or None
    """
    from lfsr_core.pipeline.animation import SecondStage, animation_of
    from lfsr_core.pipeline.engine import FAILED, Tools, counts, render_animation, table

    started = time.monotonic()
    animation = animation_of(from_data(Request, job, "job of the animation"), frames,
                             from_data(SecondStage, second, "second stage of the animation"), lenient=True)
    blender = RenderCommand(tuple(command))
    # The panel says itself how much time is left.
    tools = Tools(blender, emit_progress, emit_warning, overwrite=overwrite, tells_left=False)
    results = render_animation(animation, tools)
    _warn_of_older(animation, results)
    failed = [f"frame {result.frame}: {result.error}" for result in results if result.state == FAILED]
    return {"table": table(results), "sentence": counts(results, time.monotonic() - started),
            "failed": failed[0] if failed else None}


def _warn_of_older(animation: Animation, results: Sequence[Result]) -> None:
    from lfsr_core.pipeline.animation import is_older
    from lfsr_core.pipeline.engine import KEPT

    older = [job.frame for job, result in zip(animation.jobs, results, strict=True)
             if result.state == KEPT and is_older(animation, job)]
    if older:
        count = "1 frame is" if len(older) == 1 else f"{len(older)} frames (from {older[0]}) are"
        emit_warning(f"{count} older than this file. Turn on Overwrite to render again")
