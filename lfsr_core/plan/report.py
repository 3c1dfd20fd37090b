"""A finished plan as a table, as JSON, and in a sentence."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from lfsr_core.frames.job import Job
from lfsr_core.plan.candidates import BETWEEN, Choice, Rated
from lfsr_core.plan.options import Options
from lfsr_core.plan.planner import Planned

HEADINGS = ("", "scale", "spp", "method", "seconds", "accuracy", "95 % above", "")


def table(planned: Planned, options: Options) -> str:
    """Measured candidates and the chosen one, cheapest first, what the sample cost, the choice in a sentence."""
    shown = [row for row in planned.rated if row.note != BETWEEN or row is planned.choice.chosen]
    rows = [HEADINGS, *(_row(row, planned.choice, options) for row in shown)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([*lines, "", cost(planned), sentence(planned.choice, options)])


def cost(planned: Planned) -> str:
    """What was looked at and what that cost."""
    sample = planned.sample
    seconds = sample["seconds"] + sample["measuring_seconds"]
    return (f"sampled {sum(sample['lenses'].values())} lenses in {seconds:.0f} s: {sample['share']:.1%} of the path "
            f"samples of {sample['dearest']}, {seconds / sample['dearest_seconds']:.1%} of its "
            f"{sample['dearest_seconds']:.0f} s")


def sentence(choice: Choice, options: Options) -> str:
    """The outcome for a person."""
    if choice.chosen is not None:
        row = choice.chosen
        return (f"{row.candidate.name} reaches {options.metric} {options.target:g} with 95 % confidence "
                f"({row.estimate.mean:.3f}, at least {row.estimate.low:.3f}) in about {row.seconds:.0f} s")
    if choice.best is None:
        return f"nothing reaches {options.metric} {options.target:g}: {choice.limit}"
    row = choice.best
    return (f"nothing reaches {options.metric} {options.target:g} with 95 % confidence; best is {row.candidate.name} "
            f"({row.estimate.mean:.3f}, at least {row.estimate.low:.3f}). Limit: {choice.limit}")


def as_json(planned: Planned, options: Options, job: Job) -> dict[str, Any]:
    """Everything that was measured, see docs/guide/plan.md."""
    settings = dataclasses.asdict(options)
    if math.isinf(options.most_seconds):
        settings["most_seconds"] = None
    choice = planned.choice
    return {"scene": job.scene, "display": job.display.name, "seed": job.seed, "options": settings,
            "sample": planned.sample, "candidates": [_data(row) for row in planned.rated],
            "chosen": choice.chosen and _data(choice.chosen), "best": choice.best and _data(choice.best),
            "limit": choice.limit, "sentence": sentence(choice, options)}


def _row(row: Rated, choice: Choice, options: Options) -> tuple[str, ...]:
    mark = "→" if row is choice.chosen else ""
    known = ("–", "–") if row.estimate is None else (f"{row.estimate.mean:.3f}", f"{row.estimate.low:.3f}")
    note = row.note or ("meets it" if row.estimate is not None and row.estimate.low >= options.target else "")
    candidate = row.candidate
    return mark, str(candidate.scale), str(candidate.spp), candidate.method, f"{row.seconds:.1f}", *known, note


def _data(row: Rated) -> dict[str, Any]:
    estimate = row.estimate and dataclasses.asdict(row.estimate)
    return {**dataclasses.asdict(row.candidate), "seconds": row.seconds, "estimate": estimate, "note": row.note}
