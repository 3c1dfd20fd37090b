"""The timeline's frames for the add-on, rendered and finished as ``lfsr render --frames`` does it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lfsr_core.render.protocol import emit_progress, emit_warning
from lfsr_core.tasks.render_command import RenderCommand

if TYPE_CHECKING:
    from lfsr_core.sequence.engine import Result
    from lfsr_core.sequence.shot import Shot


def animation(job: dict[str, Any], frames: list[int], second: dict[str, Any], command: list[str],
              overwrite: bool = False) -> dict[str, Any]:
    """Render and finish frames of a scene, those that are not done.

    Frames of other settings are made again: the panel shows what is wanted. Those of a scene that has changed are
    kept, with a warning, since a file changes with every click.

    Parameters
    ----------
    job : data of a frames.job.Job whose output is the folder of the frames' folders
    frames : their numbers
    second : data of a sequence.shot.SecondStage
    command : words that start a render, before the job files
    overwrite : whether frames that are done are made again

    Returns
    -------
    "table", a line per frame; "sentence", what became of all; "failed", the first failed frame's sentence or none
    """
    from lfsr_core.frames.job import Job
    from lfsr_core.records import from_data
    from lfsr_core.sequence.engine import FAILED, Tools, render_shot
    from lfsr_core.sequence.shot import SecondStage, shot_of
    from lfsr_core.sequence.summary import counts, table

    started = time.monotonic()
    shot = shot_of(from_data(Job, job, "job of the animation"), frames,
                   from_data(SecondStage, second, "second stage of the animation"), lenient=True)
    blender = RenderCommand(tuple(command))
    results = render_shot(shot, Tools(blender, emit_progress, emit_warning, overwrite=overwrite))
    _warn_of_older(shot, results)
    failed = [f"frame {result.frame}: {result.error}" for result in results if result.state == FAILED]
    return {"table": table(results), "sentence": counts(results, time.monotonic() - started),
            "failed": failed[0] if failed else None}


def _warn_of_older(shot: Shot, results: Sequence[Result]) -> None:
    from lfsr_core.sequence.engine import KEPT
    from lfsr_core.sequence.shot import is_older

    older = [job.frame for job, result in zip(shot.jobs, results, strict=True)
             if result.state == KEPT and is_older(shot, job)]
    if older:
        emit_warning(f"of the frames that are kept {len(older)}, beginning with frame {older[0]}, were rendered before "
                     "this file was changed: tick Overwrite if the change shows in them")
