"""A finished plan as a table, as JSON, and in a sentence."""

from __future__ import annotations

import dataclasses

from lfsr_core.frames.job import Job
from lfsr_core.plan.candidates import BETWEEN, Choice, Rated
from lfsr_core.plan.estimate import Estimate
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.planner import Planned, SampleFacts

MOST_ROWS = 5  # so that heading, rows, what it cost, the sentence and the command are ten lines
HEADINGS = ("", "scale", "spp", "method", "seconds", "accuracy", "95 % above", "")


def table(planned: Planned, options: PlanOptions, details: bool = True) -> str:
    """Measured candidates and the chosen one, cheapest first, what the sample cost, the choice in a sentence.

    Without ``details`` ten lines: of the candidates those that no cheaper one equals, around the choice.
    """
    shown = [row for row in planned.rated if row.note != BETWEEN or row is planned.choice.chosen]
    shown = shown if details else _front(shown, planned.choice)
    rows = [HEADINGS, *(_row(row, planned.choice, options) for row in shown)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([*lines, "", cost(planned), sentence(planned.choice, options)])


def _front(rows: list[Rated], choice: Choice) -> list[Rated]:
    """At most MOST_ROWS: each more accurate than all cheaper ones, up to the choice and one beyond it."""
    best, front = float("-inf"), []
    for row in rows:
        low = row.estimate.low if row.estimate is not None else float("-inf")
        if low > best or row is choice.chosen:
            best = max(best, low)
            front.append(row)
    last = next((place for place, row in enumerate(front) if row is (choice.chosen or choice.best)), len(front) - 1)
    return front[:last + 2][-MOST_ROWS:]


def cost(planned: Planned) -> str:
    """What was looked at and what that cost."""
    sample = planned.sample
    seconds = sample.seconds + sample.measuring_seconds
    return (f"sampled {sum(sample.lenses.values())} lenses in {seconds:.0f} s: {sample.share:.1%} of the path "
            f"samples of {sample.costliest}, {seconds / sample.costliest_seconds:.1%} of its "
            f"{sample.costliest_seconds:.0f} s")


def sentence(choice: Choice, options: PlanOptions) -> str:
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


@dataclasses.dataclass(frozen=True)
class CandidateReport:
    """What a plan says of one candidate."""

    # scale, spp, method: the candidate
    scale: int
    spp: int
    method: str
    seconds: float  # predicted for a whole frame
    estimate: Estimate | None  # accuracy, None where it was not measured
    note: str  # why it was not, or BETWEEN

    @classmethod
    def of(cls, row: Rated) -> CandidateReport:
        """Of what is known."""
        return cls(row.candidate.scale, row.candidate.spp, row.candidate.method, row.seconds, row.estimate, row.note)


@dataclasses.dataclass(frozen=True)
class PlanReport:
    """Everything that was measured, as `lfsr plan --json` writes it, see docs/guide/plan.md."""

    # scene, display, seed: what was planned for
    scene: str
    display: str
    seed: int
    options: PlanOptions  # of the plan
    sample: SampleFacts  # what was looked at, and what that cost
    candidates: tuple[CandidateReport, ...]  # all of them, cheapest first
    chosen: CandidateReport | None  # the cheapest that meets the target, None where none does
    best: CandidateReport | None  # the measured candidate with the highest lower bound, None without any
    limit: str  # why nothing meets the target, else empty
    sentence: str  # the outcome for a person


def plan_report(planned: Planned, options: PlanOptions, job: Job) -> PlanReport:
    """The report of a finished plan."""
    choice = planned.choice
    chosen, best = (row and CandidateReport.of(row) for row in (choice.chosen, choice.best))
    return PlanReport(job.scene, job.display.name, job.seed, options, planned.sample,
                      tuple(map(CandidateReport.of, planned.rated)), chosen, best, choice.limit,
                      sentence(choice, options))


def _row(row: Rated, choice: Choice, options: PlanOptions) -> tuple[str, ...]:
    mark = "→" if row is choice.chosen else ""
    known = ("–", "–") if row.estimate is None else (f"{row.estimate.mean:.3f}", f"{row.estimate.low:.3f}")
    note = row.note or ("meets it" if row.estimate is not None and row.estimate.low >= options.target else "")
    candidate = row.candidate
    return mark, str(candidate.scale), str(candidate.spp), candidate.method, f"{row.seconds:.1f}", *known, note
