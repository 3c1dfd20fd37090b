"""A plan for the add-on, whose Blender renders the sample."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.plan.candidates import Candidate
from lfsr_core.render.protocol import emit_progress, emit_warning
from lfsr_core.tasks.render_command import RenderCommand


@dataclasses.dataclass(frozen=True)
class Found:
    """What a plan found, for the panel."""

    sentence: str
    # The cheapest that meets the target; None where nothing does.
    chosen: Candidate | None


def plan(job: dict[str, Any], options: dict[str, Any], command: list[str], work: str) -> dict[str, Any]:
    """Plan for the scene of a job.

    Parameters
    ----------
    job : data of a frames.job.Job
    options : data of a plan.options.PlanOptions
    command : words that start a render, before the job file
    work : folder for the sample

    Returns
    -------
    Data of a ``Found``.
    """
    from lfsr_core.frames.job import Job
    from lfsr_core.plan.moving import Moving
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import make_plan
    from lfsr_core.plan.renders import rendering
    from lfsr_core.plan.report import sentence
    from lfsr_core.records import from_data, to_data

    wanted = from_data(PlanOptions, options, "options of the plan")
    moving = Moving(emit_progress)
    render = rendering(RenderCommand(tuple(command)), emit_warning, moving)
    planned = make_plan(from_data(Job, job, "job of the plan"), wanted, render, Path(work), moving)
    chosen = planned.choice.chosen
    return to_data(Found(sentence(planned.choice, wanted), chosen and chosen.candidate))
