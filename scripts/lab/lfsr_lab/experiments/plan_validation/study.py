"""Are plans right?

Plans every scene of a folder of renders (lfsr_lab.experiments.plan_validation.actual) for several targets and seeds,
and holds each plan against whole frames and references: does the chosen candidate meet the target, and what does it
cost against the best choice in hindsight. With --replay the sampled lenses are cut out of the bench's frames, so that
many seeds cost no render; without, they are rendered.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import math
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np
from einops import rearrange

from lfsr_core.base.messages import LfsrError, Tell
from lfsr_core.base.records import to_data, write_record
from lfsr_core.commands.common import names, numbers
from lfsr_core.frames.frame import (
    FRAME_FILE,
    LOW_RES_FILE,
    REFERENCE_FILES,
    WORLD_FILE,
    Frame,
    Request,
    parse_frames,
    read_frame,
    write_frame,
)
from lfsr_core.images.image_files import read_layers, write_layers
from lfsr_core.metrics.eia_metrics import NORMAL_95
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import to_elemental_images
from lfsr_core.pipeline.make import make
from lfsr_core.plan.options import Candidate, PlanOptions, path_samples, render_seconds
from lfsr_core.plan.planner import Planned, make_plan
from lfsr_core.process.child import find_blender
from lfsr_core.reconstruct.second_stage import finish_frame, finished_linear
from lfsr_lab.experiments.engine.records import REFERENCE, Records
from lfsr_lab.experiments.engine.report import markdown_table
from lfsr_lab.experiments.engine.timing import scratch_copy
from lfsr_lab.experiments.engine.truth import Truth

RENDER_FOLDER = re.compile(r"s(\d+)-spp(\d+)")
_read_layers = functools.lru_cache(maxsize=16)(read_layers)


@dataclasses.dataclass(frozen=True)
class Actual:
    """``accuracy`` by the metric of sampled lenses (docs/reference/metrics.md), ``seconds`` of the whole frame."""

    accuracy: float
    seconds: float


def scenes(bench: Path) -> list[Path]:
    """Return the folders of the scenes with a reference and at least one render."""
    return sorted(path.parents[1] for path in bench.glob(f"*/{REFERENCE}/{FRAME_FILE}") if renders(path.parents[1]))


def renders(scene: Path) -> dict[tuple[int, int], Path]:
    folders = {}
    for path in scene.glob(f"s*-spp*/{FRAME_FILE}"):
        name = RENDER_FOLDER.fullmatch(path.parent.name)
        if name and (path.parent / LOW_RES_FILE).exists():
            folders[int(name[1]), int(name[2])] = path.parent
    return folders


def actuals(scene: Path, candidates: Sequence[Candidate], records: Records[Actual],
            rate: float | None = None) -> dict[Candidate, Actual]:
    """Return what candidates reach as whole frames, measured unless it is in ``records``; ``rate`` as ``timed_frame``.

    A candidate that cannot be made is left out; LfsrError where none can, or where the reference is of sampled lenses
    only: its own uncertainty would be as large as the plan's.
    """
    reached = {}
    for candidate in candidates:
        try:
            reached[candidate] = records.get(f"{candidate.name.replace(' ', '-')}-{PlanOptions.metric}", {"rate": rate}
                                             if rate else {}, functools.partial(_measure, scene, candidate, rate))
        except LfsrError as error:
            if candidate == candidates[-1] and not reached:
                raise
            print(f"{scene.name}, {candidate.name}: {error}", file=sys.stderr)
    return reached


def _measure(scene: Path, candidate: Candidate, rate: float | None) -> Actual:
    folder, target = renders(scene)[candidate.scale, candidate.samples], _target(scene / REFERENCE)
    target.check(read_frame(folder))
    similarity = target.lens_ssim(finished_linear(folder, candidate.method))
    with scratch_copy(folder) as copy:  # render, as it took then, and second stage, as it takes now
        write_frame(copy, timed_frame(folder, rate))
        seconds = finish_frame(copy, candidate.method).seconds
    return Actual(float(similarity.mean()), sum(seconds.values()))


@functools.lru_cache(maxsize=1)
def _target(folder: Path) -> Truth:
    """Read a reference, which must show every lens."""
    if read_frame(folder).lens_list is not None:
        raise LfsrError(f"the reference {folder} is of sampled lenses only, but all are needed: render it without "
                        "--lenses")
    return Truth(folder)


def timed_frame(folder: Path, rate: float | None = None) -> Frame:
    """Return the frame of a render; with ``rate``, seconds of a path sample, as if it had taken those of its samples.

    The machine was busy when it rendered.
    """
    frame = read_frame(folder)
    seconds = {"open": 0.0, "render": rate * path_samples(frame)} if rate else frame.seconds
    return dataclasses.replace(frame, seconds=seconds)


def setup_seconds(scene: Path, rate: float | None = None) -> float:
    """Return the seconds that every render of the scene takes whatever its size, from a fitted line."""
    frames = [timed_frame(folder, rate) for folder in renders(scene).values()]
    samples, seconds = np.array([(path_samples(frame), render_seconds(frame)) for frame in frames], float).T
    if len(set(samples)) < 2:
        return 0.0
    # By their inverse, so that seconds of short renders count as much as those of long ones.
    return float(np.clip(np.polyfit(samples, seconds, 1, w=1 / np.maximum(seconds, 1e-6))[1], 0, seconds.min()))


def replay(scene: Path, job: Request, rate: float | None = None) -> None:
    """Do ``job`` by cutting its lenses out of a whole frame of the folder, instead of rendering them.

    Seconds are the scene's set-up and what is left of the frame's, for as many pixels. A reference's two halves show
    the same half of the bench's, which of them the seed decides. ``rate`` as of ``timed_frame``.
    """
    source = scene / REFERENCE
    if job.kind == "render":  # the one asked for, else of its scale that of nearest samples
        paths = {spp: path for (scale, spp), path in renders(scene).items() if scale == job.sampling.scale}
        if not paths:
            raise LfsrError(f"{scene} has no render of scale {job.sampling.scale}, where a plan starts: render one")
        source = paths[min(paths, key=lambda spp: abs(spp - job.sampling.samples))]
    frame, target = timed_frame(source, rate), Path(job.output)
    tiled = dataclasses.replace(frame, lens_list=job.lens_list, seed=job.seed, samples=job.sampling.samples)
    fraction = np.prod(tiled.rays.size) / np.prod(frame.rays.size) * job.sampling.samples / frame.samples
    target.mkdir(parents=True, exist_ok=True)
    names = REFERENCE_FILES if job.kind == "reference" else (LOW_RES_FILE,)
    part = int(target.name[-1]) if job.kind == "reference" else 0
    cut = dict(_read_layers(source / names[part]))
    if tiled.lens_list is not None:  # spare tiles repeat the last, as RayLayout places them
        across, down = tiled.rays.tiles
        rows, columns = np.asarray(tiled.lens_list)[np.minimum(np.arange(across * down), len(tiled.lens_list) - 1)].T
        for layer, pixels in cut.items():
            images = to_elemental_images(pixels, frame.rays.tiles)[rows, columns]
            cut[layer] = rearrange(images, "(down across) y x c -> (down y) (across x) c", down=down)
    for name in names:
        write_layers(target / name, cut)
    if frame.world_apart:
        shutil.copy(source / WORLD_FILE, target)
    whole, world = render_seconds(frame), 0.0 if job.world else frame.seconds.get("world", 0.0)
    setup = min(setup_seconds(scene, rate), whole)
    seconds = {**frame.seconds, "world": world, "render": world + setup + (whole - setup) * float(fraction)}
    write_frame(target, dataclasses.replace(tiled, seconds=seconds))


@dataclasses.dataclass(frozen=True)
class Verdict:
    # scene, seed, target: which plan
    scene: str
    seed: int
    target: float
    chosen: str | None  # name of the chosen candidate, None where nothing met the target
    hindsight: str | None  # the cheapest candidate that meets the target as a whole frame, None where none does
    sample: dict[str, Any]  # facts of its lenses and their cost, as in a plan's JSON
    limit: str  # why nothing was chosen
    # Of each measured candidate: its name, its accuracy as a whole frame, whether its lower bound holds, its estimate
    # minus its accuracy, and predicted over actual seconds.
    measured: tuple[str, ...] = ()
    actuals: tuple[float, ...] = ()
    covered: tuple[bool, ...] = ()
    errors: tuple[float, ...] = ()
    times: tuple[float, ...] = ()
    # Of the chosen candidate, None without one: its estimate and lower bound, its accuracy as a whole frame, and
    # whether that meets the target.
    estimate: float | None = None
    bound: float | None = None
    actual: float | None = None
    met: bool | None = None
    # Seconds and path samples of the chosen candidate over those of the one in hindsight, where the target is met.
    cost: float | None = None
    samples: float | None = None


@dataclasses.dataclass(frozen=True)
class Summary:
    """Over all plans: how often the target was met, what it cost, and how good the estimates were."""

    # plans, chosen: plans, and those that chose a candidate
    plans: int
    chosen: int
    met: float | None  # fraction of these whose candidate meets the target
    nothing_chosen_though_possible: int  # plans that chose none although one meets the target
    costs: int  # plans whose cost is known, as Verdict.cost
    # median_cost, cheap_enough: the median of these costs, and the fraction of at most CHEAP_ENOUGH
    median_cost: float | None
    cheap_enough: float | None
    bounds_below_actual: float | None  # fraction of all lower bounds that hold
    mean_error: float | None  # of all estimates
    median_predicted_over_actual_seconds: float | None  # of all candidates
    # mean_share_of_seconds, mean_share_of_samples: of a sample in the costliest candidate's frame
    mean_share_of_seconds: float | None
    mean_share_of_samples: float | None
    # 95 % intervals (Wilson) as if all plans were independent, which those of a scene are not.
    met_95: tuple[float, float] | None = None  # of ``met``
    cheap_enough_95: tuple[float, float] | None = None  # of ``cheap_enough``
    scenes: int = 0  # with plans
    scenes_all_met: int = 0  # where every plan that chose met its target


@dataclasses.dataclass(frozen=True)
class Validation:
    """The file of a validation: whether renders were replayed, its ``summary`` and all ``plans``."""

    replay: bool
    summary: Summary
    plans: tuple[Verdict, ...]


TARGETS = (0.8, 0.85, 0.9, 0.925, 0.95, 0.97)
CANDIDATE_COLUMNS = ("scene", "candidate", "actual", "estimate", "least", "most", "bounds below", "seconds: predicted "
                     "over actual")
CHEAP_ENOUGH = 1.2  # times the cost of the best choice in hindsight
COLUMNS = ("scene", "seed", "target", "chosen", "estimate", "bound", "actual", "met", "hindsight", "cost", "samples")
TRUTH = "truth"  # folder of measured candidates beside a scene's samples
Actuals = dict[Candidate, Actual]


@dataclasses.dataclass(frozen=True)
class Draws:
    """How often plans of a scene are made, and for what."""

    output: Path  # folder of what is measured, one for each scene in it
    seeds: Sequence[int]  # of the lenses; one sample of a seed serves all targets
    targets: Sequence[float]
    scene_file: str = ""  # what Blender opens; empty: renders are replayed
    blender: str | None = None
    rate: float | None = None  # seconds of a path sample, None for those that renders took


def validate(scene: Path, plans: PlanOptions, draws: Draws) -> Iterator[Verdict]:
    """Yield a verdict per seed and target.

    Parameters
    ----------
    scene : folder of the scene
    plans : options of the plans, apart from their targets
    draws : how many
    """
    display, folder = read_frame(scene / REFERENCE).display, draws.output / scene.name
    there = renders(scene)
    scales = tuple(sorted({scale for scale, _ in there}))
    everywhere = tuple(samples for samples in plans.samples if all((scale, samples) in there for scale in scales))
    plans = dataclasses.replace(plans, scales=scales, samples=everywhere)
    reached = actuals(scene, plans.candidates(display), Records(folder / TRUTH, Actual), draws.rate)
    blender = find_blender(draws.blender) if draws.scene_file else None

    def render(request: Request, tell: Tell) -> None:
        if blender is None:
            replay(scene, request, draws.rate)
        else:
            make(request, blender=blender, tell=tell)

    for seed in draws.seeds:
        print(f"{scene.name}, seed {seed}", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory(prefix="lfsr-replay-") as replayed:
            work = folder / f"seed-{seed}" if draws.scene_file else replayed
            job = Request(output=str(work), display=display, scene=draws.scene_file, seed=seed)
            for target in draws.targets:
                planned = make_plan(job, dataclasses.replace(plans, target=target), render, work)
                yield judge(planned, reached, display, scene.name, seed, target)


def judge(planned: Planned, actuals: Actuals, display: DisplayProfile, scene: str, seed: int, target: float) -> Verdict:
    """Compare a plan for a scene, seed of lenses and target with what its candidates reach and take as whole frames."""
    meeting = [candidate for candidate, actual in actuals.items() if actual.accuracy >= target]
    best = min(meeting, key=lambda candidate: actuals[candidate].seconds, default=None)
    measured = [(row, row.estimate, actuals[row.candidate]) for row in planned.candidates
                if row.estimate is not None and row.candidate in actuals]
    row = planned.choice.chosen
    verdict = Verdict(
        scene, seed, target, row.candidate.name if row else None, best.name if best else None,
        sample=to_data(planned.sample), limit=planned.choice.limit.code if planned.choice.limit else "",
        covered=tuple(estimate.low <= actual.accuracy for _, estimate, actual in measured),
        errors=tuple(estimate.mean - actual.accuracy for _, estimate, actual in measured),
        times=tuple(row.seconds / actual.seconds for row, _, actual in measured),
        measured=tuple(row.candidate.name for row, *_ in measured),
        actuals=tuple(actual.accuracy for *_, actual in measured))
    if row is None or row.estimate is None:
        return verdict
    actual = actuals[row.candidate]
    verdict = dataclasses.replace(verdict, estimate=row.estimate.mean, bound=row.estimate.low, actual=actual.accuracy,
                                  met=actual.accuracy >= target)
    if best is None or not verdict.met:
        return verdict
    samples = row.paths(display) / best.paths(display)
    return dataclasses.replace(verdict, cost=actual.seconds / actuals[best].seconds, samples=samples)


def summary(rows: Sequence[Verdict]) -> Summary:
    chosen = [row for row in rows if row.met is not None]
    costs = [row.cost for row in rows if row.cost is not None]
    possible = [row for row in rows if row.hindsight is not None]
    return Summary(
        plans=len(rows), chosen=len(chosen), met=_if_any(fmean, [bool(row.met) for row in chosen]),
        nothing_chosen_though_possible=sum(row.chosen is None for row in possible), costs=len(costs),
        median_cost=_if_any(median, costs), cheap_enough=_if_any(fmean, [cost <= CHEAP_ENOUGH for cost in costs]),
        bounds_below_actual=_if_any(fmean, [covered for row in rows for covered in row.covered]),
        mean_error=_if_any(fmean, [error for row in rows for error in row.errors]),
        median_predicted_over_actual_seconds=_if_any(median, [time for row in rows for time in row.times]),
        mean_share_of_seconds=_if_any(fmean, [row.sample["seconds"] / row.sample["costliest_seconds"] for row in rows]),
        mean_share_of_samples=_if_any(fmean, [row.sample["fraction"] for row in rows]),
        met_95=wilson([bool(row.met) for row in chosen]),
        cheap_enough_95=wilson([cost <= CHEAP_ENOUGH for cost in costs]),
        scenes=len({row.scene for row in rows}),
        scenes_all_met=len({row.scene for row in chosen} - {row.scene for row in chosen if not row.met}))


def markdown(rows: Sequence[Verdict]) -> str:
    """Return tables of all plans, of the candidates that they measured, and of the summary."""
    lines = markdown_table(COLUMNS, ([getattr(row, name) for name in COLUMNS] for row in rows))
    figures: dict[tuple[str, str], dict[int, tuple[Any, ...]]] = {}  # of each candidate of a scene, by draw of lenses
    for row in rows:
        for name, *values in zip(row.measured, row.actuals, row.errors, row.covered, row.times, strict=True):
            figures.setdefault((row.scene, name), {}).setdefault(row.seed, tuple(values))
    candidates = []
    for (scene, name), draws in sorted(figures.items()):
        actuals, errors, covered, times = zip(*draws.values(), strict=True)
        estimates = np.add(actuals, errors)
        candidates.append([scene, name, actuals[0], estimates.mean(), estimates.min(), estimates.max(),
                           f"{sum(covered)} of {len(draws)}", _if_any(median, times)])
    lines += ["", *markdown_table(CANDIDATE_COLUMNS, candidates)]
    whole = dataclasses.asdict(summary(rows))
    lines += ["", *markdown_table(("over all plans", ""),
                                  [(name.replace("_", " "), value) for name, value in whole.items()])]
    return "\n".join(lines) + "\n"


def wilson(outcomes: Sequence[bool]) -> tuple[float, float] | None:
    """Return the 95 % interval (Wilson) of the fraction of independent outcomes that are true, None without any."""
    count, z2 = len(outcomes), NORMAL_95**2
    if not count:
        return None
    fraction = sum(outcomes) / count
    middle, half = fraction + z2 / (2 * count), math.sqrt(z2 * (fraction * (1 - fraction) + z2 / (4 * count)) / count)
    return (middle - half) / (1 + z2 / count), (middle + half) / (1 + z2 / count)


def _if_any(statistic: Callable[[Sequence[float]], float], values: Sequence[float]) -> float | None:
    """Return the mean or median of ``values``, None without any."""
    return float(statistic(values)) if values else None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bench", type=Path, help="folder with whole references and renders, as of `lfsr study chart`")
    add("--json", type=Path, required=True)
    add("--scenes", type=Path, nargs="*", default=[], help="scene files; needless with --replay")
    add("--replay", action="store_true", help="cut the sample out of the bench's frames")
    add("--targets", type=lambda text: tuple(map(float, text.split(","))), default=TARGETS)
    add("--seeds", type=parse_frames, default=(101,))
    add("--spps", type=numbers, default=PlanOptions.samples)
    add("--methods", type=names)
    add("--lenses", type=int)
    add("--rate", type=float, metavar="SECONDS",
        help="of a path sample, in place of those that renders took: where the machine was busy, and to judge by rays")


def run(options: argparse.Namespace) -> None:
    """Validate every scene, write the JSON after each, print the tables."""
    files = {path.stem: str(path.resolve()) for path in options.scenes}
    plans = PlanOptions(samples=options.spps, methods=options.methods, lenses=options.lenses)
    rows: list[Verdict] = []
    for scene in scenes(options.bench):
        if options.replay or scene.name in files:
            draws = Draws(options.output, options.seeds, options.targets,
                          "" if options.replay else files[scene.name], options.blender, options.rate)
            rows += validate(scene, plans, draws)
            write_record(options.json, Validation(options.replay, summary(rows), tuple(rows)))
    if not rows:
        raise LfsrError(f"{options.bench} has no scene of the files given: name them, or use --replay")
    print(markdown(rows))
