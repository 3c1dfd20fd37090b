"""Does `lfsr plan` see where methods break?

STRESS is a finished folder of `lfsr study stress`. Each sweep's scene at the default's breaking point is rendered
whole at every scale and sample count of a plan, and plans are replayed on it (`lfsr study plans`). Their target is what
the default has at the sweep's first value less DROP: what it misses once it is broken. Where it never breaks, the scene
is that of the fast method's breaking point, else of the last value.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from lfsr_core.base.records import read_record, write_record
from lfsr_core.frames.frame import Request, Sampling
from lfsr_core.plan.options import PlanOptions
from lfsr_core.reconstruct.methods import FAST_METHOD
from lfsr_lab.experiments.engine.records import Store
from lfsr_lab.experiments.engine.report import UNKNOWN, markdown_table, number
from lfsr_lab.experiments.engine.truth import MAIN_METRICS
from lfsr_lab.experiments.plan_validation.study import Draws, Validation, Verdict, summary, validate
from lfsr_lab.experiments.sweeps.measure import Scene
from lfsr_lab.experiments.sweeps.records import DROP, MOTION, Report, SweepReport, choose_sweeps, label

SCALES, SPPS, SEEDS = (1, 2, 4), (4, 16, 64), (0, 1, 2)
JUDGED = "ssim_lens_fg"  # what plans are made for
RATE = 1e-4  # seconds of a path sample, so large that plans minimise path samples, as on displays of many lenses
COLUMNS = ("sweep", "from – to", "default, scores", "target", "plan at", "chosen", "met", "cost")


def value_of(sweep: SweepReport) -> float:
    breaks = (sweep.breaks.get(name) for name in (_default(sweep), FAST_METHOD))
    return next((broken.value for broken in breaks if broken), sweep.values[-1])


def _default(sweep: SweepReport) -> str:
    """Return the method that was the default when the sweep was measured: the last one."""
    return sweep.cells[-1].method


def target_of(sweep: SweepReport) -> float:
    """Return the target of the plans: the default's accuracy at the first value less DROP, two digits, rounded down."""
    first = sweep.series(_default(sweep), JUDGED)[0] or 0.0
    return math.floor(100 * (first - DROP) + 1e-6) / 100


def jobs_of(scene: Scene) -> list[Request]:
    """Return the whole renders that plans are replayed from."""
    job = scene.job()
    return [dataclasses.replace(job, output=str(scene.folder / f"s{scale}-spp{spp}"), sampling=Sampling(scale, spp))
            for scale in SCALES for spp in SPPS]


def verdicts(report: Report, store: Store, output: Path) -> Iterator[Verdict]:
    """Yield a verdict per sweep and draw of lenses; what is missing is rendered. No plan sees the motion."""
    for sweep in report.sweeps:
        if sweep.name == MOTION:
            continue
        scene = Scene(store, report.settings, choose_sweeps([sweep.name])[0], value_of(sweep))
        store.render_all([scene.reference_job, *jobs_of(scene)])
        draws = Draws(output, SEEDS, (target_of(sweep),), rate=RATE)
        yield from validate(scene.folder, PlanOptions(samples=SPPS), draws)


def table(report: Report, plans: Iterable[Verdict]) -> list[str]:
    """Return the lines of the table: where each method breaks, and what plans choose there.

    The default's scores are its judged figures at the first value, in the middle and at the last.
    """
    rows = list(plans)
    return markdown_table([*COLUMNS[:2], *(f"`{name}`" for name in report.methods), *COLUMNS[2:]],
                          (_row(sweep, report.methods, rows) for sweep in report.sweeps))


def _row(sweep: SweepReport, methods: Sequence[str], rows: Sequence[Verdict]) -> list[str]:
    value = value_of(sweep)
    made = [row for row in rows if row.scene == choose_sweeps([sweep.name])[0].scene_name(value)]
    scores = sweep.series(_default(sweep), sweep.judged)
    shown = " ".join(number(scores[place]).lstrip("0") for place in (0, len(scores) // 2, -1))
    judged = "" if sweep.judged == MAIN_METRICS[0] else f" (`{sweep.judged}`)"
    breaks = [f"{sweep.name}{judged}", sweep.span.replace(" ", ""), *map(sweep.break_text, methods), shown]
    if not made:
        return [*breaks, *[UNKNOWN] * 5]
    chosen = dict.fromkeys(row.chosen or f"nothing ({row.limit.partition(':')[0]})" for row in made)
    costs = [row.cost for row in made if row.cost is not None]
    return [*breaks, f"{made[0].target:.2f}", label(value), "; ".join(chosen),
            f"{sum(bool(row.met) for row in made)}/{len(made)}",
            "–".join(dict.fromkeys(f"{cost:.2f}" for cost in (min(costs), max(costs)))) if costs else UNKNOWN]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("stress", type=Path, metavar="STRESS", help="finished folder of `lfsr study stress`")
    parser.add_argument("--json", type=Path, required=True, metavar="FILE")


def run(arguments: argparse.Namespace) -> None:
    """Make the plans, write them to the JSON file after each sweep, and print the table."""
    report = read_record(arguments.stress / "stress.json", Report, "a report of `lfsr study stress`")
    rows: list[Verdict] = []
    for verdict in verdicts(report, Store(arguments.stress, arguments.blender), arguments.output):
        rows.append(verdict)
        write_record(arguments.json, Validation(True, summary(rows), tuple(rows)))
    print("\n".join(table(report, rows)))
