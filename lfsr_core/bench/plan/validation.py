"""Are plans right? ``python -m lfsr_core.bench.plan.validation BENCH -o DIR --json FILE [--replay]``

Plans every scene of a bench folder (lfsr_core.bench.plan.truth) for several
targets and seeds, and holds each plan against whole frames and references: does
the chosen candidate truly meet the target, and what does it cost against the best
choice in hindsight. With --replay the sampled lenses are cut out of the bench's
frames, so that many seeds cost no render; without, they are rendered.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.bench.plan import truth
from lfsr_core.errors import LfsrError
from lfsr_core.files import write_json
from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.job import Job
from lfsr_core.plan.candidates import BETWEEN, Candidate, between, samples_of
from lfsr_core.plan.options import Options
from lfsr_core.plan.planner import Planned, Render, make_plan, rendering

TARGETS = (0.8, 0.85, 0.9, 0.925, 0.95, 0.97)
CHEAP_ENOUGH = 1.2  # times the cost of the best choice in hindsight
COLUMNS = ("scene", "seed", "target", "chosen", "estimate", "bound", "truth", "met", "hindsight", "cost", "samples")
Truths = dict[Candidate, truth.Actual]


def validate(folder: Path, render: Render, options: Options, targets: Sequence[float], seed: int, work: Path,
             cache: Path, scene_file: str) -> list[dict[str, Any]]:
    """One row per target for a scene ``folder`` of the bench; the sample in ``work`` serves all targets."""
    frame = read_frame(folder / truth.REFERENCE)
    options = dataclasses.replace(options, renders=tuple(truth.renders(folder)))
    job = Job(output=str(work), display=frame.display, scene=scene_file, layers=("albedo", "normal"), seed=seed)
    truths = with_between(_truths(folder, options.candidates(job.display), options.metric, cache), options.between)
    rows = []
    for target in targets:
        planned = make_plan(job, dataclasses.replace(options, target=target), render, work)
        rows.append({"scene": folder.name, "seed": seed, "target": target} | judge(planned, truths, target, job))
    return rows


def judge(planned: Planned, truths: Truths, target: float, job: Job) -> dict[str, Any]:
    """How a plan compares with the truth. "hindsight": the cheapest candidate that truly meets the target."""
    meeting = [candidate for candidate, true in truths.items() if true.accuracy >= target]
    best = min(meeting, key=lambda candidate: truths[candidate].seconds, default=None)
    row = planned.choice.chosen
    measured = [r for r in planned.rated if r.estimate is not None and r.note != BETWEEN and r.candidate in truths]
    result = {"chosen": row and row.candidate.name, "hindsight": best and best.name, "met": None, "cost": None,
              "samples": None, "sample": planned.sample, "limit": planned.choice.limit,
              "covered": [r.estimate.low <= truths[r.candidate].accuracy for r in measured],
              "errors": [r.estimate.mean - truths[r.candidate].accuracy for r in measured],
              "times": [r.seconds / truths[r.candidate].seconds for r in measured]}
    if row is None:
        return result
    true = truths[row.candidate]
    result |= {"estimate": row.estimate.mean, "bound": row.estimate.low, "truth": true.accuracy,
               "met": true.accuracy >= target}
    if best is not None and result["met"]:
        result |= {"cost": true.seconds / truths[best].seconds,
                   "samples": samples_of(row.candidate, job.display) / samples_of(best, job.display)}
    return result


def with_between(truths: Truths, steps: int) -> Truths:
    """``truths`` and those between them, by the same rule as a plan's (plan.between); seconds grow with the samples."""
    found = dict(truths)
    for scale, method in {(candidate.scale, candidate.method) for candidate in truths}:
        known = {c.spp: true for c, true in truths.items() if (c.scale, c.method) == (scale, method)}
        for spp, fewer, more, weight in between(list(known), steps):
            low, high, share = known[fewer], known[more], (spp - fewer) / (more - fewer)
            accuracy = low.accuracy + weight * (high.accuracy - low.accuracy)
            seconds = low.seconds + share * (high.seconds - low.seconds)
            found[Candidate(scale, spp, method)] = truth.Actual(accuracy, seconds)
    return found


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Over all plans: how often the target was met, what it cost, and how good the estimates were."""
    chosen = [row for row in rows if row["met"] is not None]
    costs = [row["cost"] for row in rows if row["cost"] is not None]
    possible = [row for row in rows if row["hindsight"] is not None]
    return {"plans": len(rows), "chosen": len(chosen), "met": _mean(row["met"] for row in chosen),
            "nothing_chosen_though_possible": sum(row["chosen"] is None for row in possible),
            "costs": len(costs), "median_cost": float(np.median(costs)) if costs else None,
            "cheap_enough": _mean(cost <= CHEAP_ENOUGH for cost in costs),
            "bounds_below_the_truth": _mean(covered for row in rows for covered in row["covered"]),
            "mean_error": _mean(error for row in rows for error in row["errors"]),
            "median_predicted_over_true_seconds": _median(time for row in rows for time in row["times"]),
            "mean_share_of_seconds": _mean(row["sample"]["share_of_seconds"] for row in rows),
            "mean_share_of_samples": _mean(row["sample"]["share"] for row in rows)}


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """A table of all plans and one of the summary."""
    lines = [_line(COLUMNS), _line(["---"] * len(COLUMNS)), *(_line([_cell(row.get(name)) for name in COLUMNS])
                                                              for row in rows)]
    lines += ["", _line(("over all plans", "")), _line(("---", "---")),
              *(_line((name.replace("_", " "), _cell(value))) for name, value in summary(rows).items())]
    return "\n".join(lines) + "\n"


def _truths(folder: Path, wanted: Sequence[Candidate], metric: str, cache: Path) -> Truths:
    found = {}
    for candidate in wanted:
        try:
            found[candidate] = truth.truth(folder, candidate, metric, cache)
        except LfsrError as error:
            if candidate == wanted[-1] and not found:
                raise
            print(f"{folder.name}, {candidate.name}: {error}", file=sys.stderr)
    return found


def _mean(values: Any) -> float | None:
    values = list(values)
    return float(np.mean(values)) if values else None


def _median(values: Any) -> float | None:
    values = list(values)
    return float(np.median(values)) if values else None


def _line(cells: Sequence[object]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "–" if value is None else f"{value:.3f}" if isinstance(value, float) else str(value)


def main(argv: Sequence[str] | None = None) -> int:
    """Validate every scene, write the JSON after each, print the tables."""
    options = _parser().parse_args(argv)
    folders = truth.scenes(options.bench)
    files = {path.stem: str(path.resolve()) for path in options.scenes}
    wanted = Options(metric=options.metric, spps=options.spps, methods=options.methods, lenses=options.lenses,
                     between=options.between, share=options.budget, reference_spp=options.reference_spp)
    rows: list[dict[str, Any]] = []
    try:
        for folder in folders:
            if options.replay or folder.name in files:
                rows += _scene(folder, wanted, options, files.get(folder.name, ""))
                write_json(options.json, {"replay": options.replay, "summary": summary(rows), "plans": rows})
        if not rows:
            raise LfsrError(f"{options.bench} has no scene of the files given: name them, or use --replay")
    except LfsrError as error:
        print(f"plan_validation: {error}", file=sys.stderr)
        return 2
    print(markdown(rows))
    return 0


def _scene(folder: Path, wanted: Options, options: argparse.Namespace, scene_file: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    cache = options.output / folder.name / "truth"
    for seed in options.seeds:
        print(f"{folder.name}, seed {seed}", file=sys.stderr, flush=True)
        if options.replay:
            with tempfile.TemporaryDirectory(prefix="lfsr-replay-") as work:
                rows += validate(folder, lambda job: truth.replay(folder, job), wanted, options.targets, seed,
                                 Path(work), cache, scene_file)
        else:
            from lfsr_core.render.blender import find_blender
            work = options.output / folder.name / f"seed-{seed}"
            rows += validate(folder, rendering(find_blender(options.blender)), wanted, options.targets, seed, work,
                             cache, scene_file)
    return rows


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="plan_validation", description=__doc__.splitlines()[0])
    parser.add_argument("bench", type=Path, help="bench folder with whole references and renders")
    parser.add_argument("-o", "--output", type=Path, required=True, help="keeps samples and truths")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--scenes", type=Path, nargs="*", default=[], help="scene files; needless with --replay")
    parser.add_argument("--replay", action="store_true", help="cut the sample out of the bench's frames")
    parser.add_argument("--targets", type=_floats, default=TARGETS)
    parser.add_argument("--seeds", type=_ints, default=(101,))
    parser.add_argument("--metric", default=Options.metric)
    parser.add_argument("--spps", type=_ints, default=Options.spps)
    parser.add_argument("--between", type=int, default=Options.between)
    parser.add_argument("--methods", type=lambda text: tuple(text.split(",")), default=None)
    parser.add_argument("--lenses", type=int, default=None)
    parser.add_argument("--budget", type=float, default=Options.share)
    parser.add_argument("--reference-spp", type=int, default=Options.reference_spp)
    parser.add_argument("--blender")
    return parser


def _floats(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))


def _ints(text: str) -> tuple[int, ...]:
    """Numbers and ranges, as in 0-9,20."""
    ends = [part.split("-") for part in text.split(",")]
    return tuple(number for end in ends for number in range(int(end[0]), int(end[-1]) + 1))


if __name__ == "__main__":
    sys.exit(main())
