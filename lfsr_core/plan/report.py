"""A finished plan as a table, as a sentence, and as JSON."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.frames.request import Request
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.candidates import BETWEEN, Choice, Rated
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.planner import Planned, SampleFacts

MOST_ROWS = 5  # so that heading, rows, cost, sentence and command are ten lines
HEADINGS = ("", "scale", "rays", "spp", "method", "seconds", "accuracy", "95 % above", "")


def table(planned: Planned, options: PlanOptions, display: DisplayProfile, details: bool = True) -> str:
    """Table of the measured candidates and the chosen one, cheapest first; the cost of the sample; the choice.

    Without ``details`` at most ten lines: candidates as accurate as a cheaper one are left out.
    """
    shown = [row for row in planned.rated if row.note != BETWEEN or row is planned.choice.chosen]
    shown = shown if details else _front(shown, planned.choice)
    rows = [HEADINGS, *(_row(row, planned.choice, options, display) for row in shown)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([*lines, "", _cost(planned.sample), sentence(planned.choice, options)])


def _front(rows: list[Rated], choice: Choice) -> list[Rated]:
    """At most MOST_ROWS: each more accurate than all cheaper ones, up to the choice and one beyond it."""
    best, front = -math.inf, []
    for row in rows:
        if row.low > best or row is choice.chosen:
            best = max(best, row.low)
            front.append(row)
    last = next((place for place, row in enumerate(front) if row is (choice.chosen or choice.best)), len(front) - 1)
    return front[:last + 2][-MOST_ROWS:]


def _cost(sample: SampleFacts) -> str:
    seconds = sample.seconds + sample.measuring_seconds
    return (f"sampled {sum(sample.lenses.values())} lenses in {seconds:.0f} s: {sample.fraction:.1%} of the path "
            f"samples of {sample.costliest}, {seconds / sample.costliest_seconds:.1%} of its "
            f"{sample.costliest_seconds:.0f} s")


def sentence(choice: Choice, options: PlanOptions) -> str:
    """The outcome in one sentence."""
    target = f"{options.metric} {options.target:g}"
    if choice.chosen is not None:
        row = choice.chosen
        return (f"{row.name} reaches {target} with 95 % confidence ({_accuracy(row)}) in about "
                f"{row.seconds:.0f} s")
    if choice.best is None:
        return f"nothing reaches {target}: {choice.limit}"
    return (f"nothing reaches {target} with 95 % confidence; best is {choice.best.name} "
            f"({_accuracy(choice.best)}). Limit: {choice.limit}")


def _accuracy(row: Rated) -> str:
    return "not measured" if row.estimate is None else f"{row.estimate.mean:.3f}, at least {row.estimate.low:.3f}"


@dataclasses.dataclass(frozen=True)
class PlanReport:
    """Everything that was measured, as `lfsr plan --json` writes it, see docs/guide/plan.md."""

    # scene, display, seed: of the job
    scene: str
    display: str
    seed: int
    options: PlanOptions
    sample: SampleFacts
    candidates: tuple[Rated, ...]  # cheapest first
    chosen: Rated | None  # the cheapest that reaches the target, None if there is none
    best: Rated | None  # the measured candidate with the highest lower bound, None if none was measured
    limit: str  # why no candidate reaches the target, else empty
    sentence: str  # the outcome


def plan_report(planned: Planned, options: PlanOptions, job: Request) -> PlanReport:
    """Report of a finished plan."""
    choice = planned.choice
    return PlanReport(job.scene, job.display.name, job.seed, options, planned.sample, planned.rated, choice.chosen,
                      choice.best, choice.limit, sentence(choice, options))


def _row(row: Rated, choice: Choice, options: PlanOptions, display: DisplayProfile) -> tuple[str, ...]:
    known = ("–", "–") if row.estimate is None else (f"{row.estimate.mean:.3f}", f"{row.estimate.low:.3f}")
    note = row.note or ("reaches it" if row.low >= options.target else "")
    mark = "→" if row is choice.chosen else ""
    rays = f"{row.spp / display.finished_pixels(row.scale):.3g}"
    return mark, str(row.scale), rays, str(row.spp), row.method, f"{row.seconds:.1f}", *known, note
