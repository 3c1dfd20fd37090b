"""The plan, step by step: render a sample of lenses and measure every candidate on it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.frames.job import Job
from lfsr_core.images.exposure import extreme_tone
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.plan import sample as plan_sample
from lfsr_core.plan.candidates import Choice, Rated, choose, low_pixels, samples_of
from lfsr_core.plan.measurements import LensSample, Measurements, Question
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.renders import REFERENCE_PARTS, Moving, SampleRenders
from lfsr_core.plan.score import QuickLook, SampledReference, quick_look
from lfsr_core.plan.times import TimeModel, path_samples, render_seconds
from lfsr_core.plan.work import sample_facts
from lfsr_core.progress import Progress, silent

PILOT_LENSES = 64
QUICK_FRACTION = 0.05  # of the plan, a guess until costs are known
SAMPLE_FILE = "sample.json"


@dataclasses.dataclass(frozen=True)
class SampleFacts:
    """The sample of a plan and its cost."""

    lenses: dict[str, int]  # number of sampled lenses of each stratum
    foreground: int  # lenses that show foreground
    costliest: str  # name of the candidate whose frame takes the most path samples
    costliest_seconds: float  # predicted for that frame
    seconds: float  # of all renders of the sample
    measuring_seconds: float  # of all second stages on it
    # cost of the sample as a fraction of the costliest candidate's frame: in path samples, and in seconds of rendering
    fraction: float = dataclasses.field(metadata={"key": "share"})
    fraction_of_seconds: float = dataclasses.field(metadata={"key": "share_of_seconds"})
    cost_ratio: float  # of a path sample in a foreground lens to one in the mean lens
    within_budget: bool  # False where the number of lenses was given or is the least possible
    reference_noise: float  # standard deviation of a half of the reference, sRGB values
    largest_gain: float  # accuracy that a candidate gained with twice the reference's samples


@dataclasses.dataclass(frozen=True)
class Planned:
    """A finished plan."""

    rated: tuple[Rated, ...]  # every candidate, cheapest first
    choice: Choice
    sample: SampleFacts


def make_plan(job: Job, options: PlanOptions, render: Callable[[Job, Progress], None], folder: str | Path,
              progress: Progress = silent) -> Planned:
    """Find the cheapest settings for the scene, display and frame of a job.

    Parameters
    ----------
    job : its scale, samples and output are ignored
    options : target, candidates, and cost of the sample
    render : renders one job into its folder, all or nothing, as ``run_job``; called with the job and its progress
    folder : holds the renders: a second call continues where one stopped
    progress : called with (stage, fraction, message)

    Raises
    ------
    LfsrError : for bad options, a scene without foreground, or as of ``render``
    """
    question = Question(job, options, tuple(options.candidates(job.display)))
    if job.layout in ("view-by-view", SUBPIXELS):
        raise LfsrError(f"a plan renders single lenses, which the layout {job.layout} cannot: choose another layout")
    _check_sample(Path(folder), question)

    report = Moving(progress)
    renders = SampleRenders(Path(folder), job, lambda job: render(job, report.rendering))
    sample, model = _sample(question, renders, report)
    measured = Measurements(question, sample, _reference(question, sample, renders, report), renders, model)
    for scale in sorted({candidate.scale for candidate in question.wanted}, reverse=True):
        for spp in sorted({candidate.spp for candidate in question.wanted if candidate.scale == scale}):
            measured.measure(scale, spp, report)
    rated = tuple(measured.rated())
    return Planned(rated, choose(rated, options.target, options.limit), _facts(measured))


def _check_sample(folder: Path, question: Question) -> None:
    """Describe the sample in ``folder``; LfsrError if the folder holds the sample of another scene or setting."""
    facts = sample_facts(question.job, question.options)
    path = folder / SAMPLE_FILE
    if path.exists() and read_json(path, "the description of a sample") != facts:
        raise LfsrError(f"{folder} holds the sample of another scene or of other options: choose another folder")
    write_json(path, facts)


def _sample(question: Question, renders: SampleRenders, report: Moving) -> tuple[LensSample, TimeModel]:
    """Choose the lenses to look at, and make a first model of a frame's cost."""
    report("looking at every lens", 0.0, QUICK_FRACTION)
    folder, frame = renders.quick()
    look = quick_look(folder)
    foreground, options = look.masks["foreground"], question.options
    if not foreground.any():
        raise LfsrError("no lens shows any foreground: check where the camera looks, and --subject")
    model = TimeModel(frame.seconds["open"], 0.0, render_seconds(frame) / path_samples(frame),
                      look.finish["load"] / low_pixels(question.display, frame.scale),
                      sum(look.finish.values()) - look.finish["load"], int(foreground.sum()), look.shown,
                      world=frame.seconds.get("world", 0.0) + look.world)
    report("measuring the cost of the foreground", QUICK_FRACTION)
    budget = plan_sample.budget(question.display, question.wanted, options.reference_spp, path_samples(frame),
                                _cost_ratio(question, renders, look, model.per_sample), options.budget)
    count = options.lenses or budget.lenses
    strata = plan_sample.sample(look.masks, count, question.job.seed, question.every_lens)
    # A given number of lenses, and the least useful number, are taken whatever they cost.
    limit = math.inf if options.lenses or count <= plan_sample.LEAST_LENSES else budget.allowed
    return LensSample(look, frame, strata, budget, limit), model


def _cost_ratio(question: Question, renders: SampleRenders, look: QuickLook, per_sample: float) -> float:
    """Cost of a path sample in a foreground lens relative to one in the mean lens, from a few lenses."""
    mask = look.masks["foreground"]
    few = plan_sample.sample({**look.masks, "edge": np.zeros_like(mask)}, PILOT_LENSES, question.job.seed, False)
    pilot = renders.pilot(few["foreground"])
    ratio = render_seconds(pilot) / path_samples(pilot) / per_sample
    # If the other lenses cost nothing, it is the inverse of the foreground's fraction; more would be set-up.
    return float(np.clip(ratio, 1, mask.size / mask.sum()))


def _reference(question: Question, sample: LensSample, renders: SampleRenders, report: Moving) -> SampledReference:
    """The sampled lenses at full resolution, in four independent quarters."""
    files, frames, lenses = [], [], sample.lenses
    steps = np.linspace(sample.done(None), sample.done([]), REFERENCE_PARTS + 1).tolist()
    for part in range(REFERENCE_PARTS):
        report(f"reference of {len(lenses)} lenses, part {part + 1} of {REFERENCE_PARTS}", *steps[part:part + 2])
        quarters, frame = renders.reference(part, question.options.reference_spp, lenses)
        files += quarters
        frames.append(frame)
    reference = SampledReference.read(files, frames[0], len(lenses))
    _check_exposure(reference)
    return reference


def _check_exposure(reference: SampledReference) -> None:
    """LfsrError if the image is almost black or white: every candidate would be perfect."""
    tone = extreme_tone(srgb_encode(np.mean(reference.quarters, 0)[reference.hits]))
    if tone:
        change = "stronger" if tone == "black" else "weaker"
        raise LfsrError(f"the sampled lenses are almost {tone}, so that every setting would seem perfect: make the "
                        f"scene's lights {change}, or check where the camera looks")


def _facts(measured: Measurements) -> SampleFacts:
    question, sample, renders = measured.question, measured.sample, measured.renders
    costliest = question.costliest
    seconds = measured.times().seconds(costliest, question.display)
    return SampleFacts(
        lenses={name: len(lenses) for name, lenses in sample.strata.items()},
        foreground=int(sample.look.masks["foreground"].sum()), costliest=costliest.name, costliest_seconds=seconds,
        seconds=renders.seconds, measuring_seconds=measured.seconds,
        fraction=renders.samples / samples_of(costliest, question.display),
        fraction_of_seconds=renders.seconds / seconds, cost_ratio=sample.budget.cost_ratio,
        within_budget=math.isfinite(sample.limit), reference_noise=measured.reference.noise,
        largest_gain=max((scores.gain for scores in measured.scores.values()), default=0.0))
