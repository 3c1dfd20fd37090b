"""Renders a sample of lenses and measures every candidate on it: the plan, step by step."""

from __future__ import annotations

import dataclasses
import math
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
from lfsr_core.plan.moving import Moving
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.renders import REFERENCE_PARTS, SampleRenders
from lfsr_core.plan.score import QuickLook, SampledReference, quick_look
from lfsr_core.plan.times import TimeModel, path_samples, render_seconds
from lfsr_core.plan.work import sample_facts
from lfsr_core.progress import Progress, silent
from lfsr_core.render.store import Render

PILOT_LENSES = 64
QUICK_SHARE = 0.05  # of the plan, a guess until costs are known
SAMPLE_FILE = "sample.json"


@dataclasses.dataclass(frozen=True)
class SampleFacts:
    """What was looked at for a plan, and what that cost."""

    lenses: dict[str, int]  # sampled, by the part of the display they stand for
    foreground: int  # lenses that show foreground
    costliest: str  # name of the candidate whose frame takes most path samples
    costliest_seconds: float  # predicted for that frame
    seconds: float  # of all renders of the sample
    measuring_seconds: float  # of all second stages on it
    share: float  # path samples of the sample, as a share of the costliest candidate's frame
    share_of_seconds: float  # the same in seconds of rendering
    cost_ratio: float  # of a sample in a foreground lens to one in the mean lens
    within_budget: bool  # False where the number of lenses was asked for or is the least possible
    reference_noise: float  # standard deviation of a half of the reference, sRGB values
    largest_gain: float  # accuracy that a candidate gained with twice the reference's samples


@dataclasses.dataclass(frozen=True)
class Planned:
    """A finished plan."""

    rated: tuple[Rated, ...]  # what is known of every candidate, cheapest first
    choice: Choice  # the cheapest that will do, or why there is none
    sample: SampleFacts  # what was looked at


def make_plan(job: Job, options: PlanOptions, render: Render, folder: Path,
              progress: Progress | Moving = silent) -> Planned:
    """Plan for the scene, display and frame of a job.

    Parameters
    ----------
    job : its scale, samples and output do not matter
    options : target, candidates, and what the sample may cost
    render : renders one job into its folder, all or nothing
    folder : keeps what was rendered: a second call goes on where one stopped
    progress : called with (stage, fraction, message) at every step; a ``Moving`` that ``render`` tells too moves in
        renders

    Raises
    ------
    LfsrError : for bad options, a scene without foreground, or what ``render`` raises
    """
    question = Question(job, options, tuple(options.candidates(job.display)))
    if job.layout in ("view-by-view", SUBPIXELS):
        raise LfsrError(f"a plan renders single lenses, which the layout {job.layout} cannot: choose another layout")
    _check_sample(folder, question)

    report = Moving.of(progress)
    renders = SampleRenders(folder, job, render)
    sample, model = _sample(question, renders, report)
    measured = Measurements(question, sample, _reference(question, sample, renders, report), renders, model)
    for scale in sorted({candidate.scale for candidate in question.wanted}, reverse=True):
        for spp in sorted({candidate.spp for candidate in question.wanted if candidate.scale == scale}):
            measured.measure(scale, spp, report)
    rated = tuple(measured.rated())
    return Planned(rated, choose(rated, options.target, options.limit), _facts(measured))


def _check_sample(folder: Path, question: Question) -> None:
    """LfsrError if ``folder`` holds the sample of another scene or setting, else its description is there."""
    same = sample_facts(question.job, question.options)
    path = folder / SAMPLE_FILE
    if path.exists() and read_json(path, "the description of a sample") != same:
        raise LfsrError(f"{folder} holds the sample of another scene or of other options: choose another folder")
    write_json(path, same)


def _sample(question: Question, renders: SampleRenders, report: Moving) -> tuple[LensSample, TimeModel]:
    """Which lenses to look at, and a first model of what a frame costs."""
    report("looking at every lens", 0.0, QUICK_SHARE)
    folder, frame = renders.quick()
    look = quick_look(folder)
    foreground, options = look.masks["foreground"], question.options
    if not foreground.any():
        raise LfsrError("no lens shows any foreground: check where the camera looks, and --subject")
    whole = low_pixels(question.display, frame.scale)
    model = TimeModel(frame.seconds["open"], 0.0, render_seconds(frame) / path_samples(frame),
                      look.finish["load"] / whole, sum(look.finish.values()) - look.finish["load"],
                      int(foreground.sum()), look.shown, world=frame.seconds.get("world", 0.0) + look.world)
    report("what the foreground costs", QUICK_SHARE)
    quick = plan_sample.QuickCost(path_samples(frame), _cost_ratio(question, renders, look, model.per_sample))
    budget = plan_sample.budget(question.display, question.wanted, options.reference_spp, quick, options.share)
    count = options.lenses or budget.lenses
    strata = plan_sample.sample(look.masks, count, question.job.seed, question.whole)
    # Fewer lenses would be of no use, and a number that was asked for is taken: then there is no limit.
    limit = math.inf if options.lenses or count <= plan_sample.LEAST_LENSES else budget.allowed
    return LensSample(look, frame, strata, budget, limit), model


def _cost_ratio(question: Question, renders: SampleRenders, look: QuickLook, per_sample: float) -> float:
    """How much more a sample costs in a foreground lens than in the mean lens, from a few of them."""
    mask = look.masks["foreground"]
    few = plan_sample.sample({**look.masks, "edge": np.zeros_like(mask)}, PILOT_LENSES, question.job.seed, False)
    pilot = renders.pilot(few["foreground"])
    ratio = render_seconds(pilot) / path_samples(pilot) / per_sample
    # Where the others cost nothing it is the inverse of the foreground's share; set-up can only add to that.
    return float(np.clip(ratio, 1, mask.size / mask.sum()))


def _reference(question: Question, sample: LensSample, renders: SampleRenders, report: Moving) -> SampledReference:
    """The sampled lenses at full resolution, in four independent quarters."""
    files, frames, lenses = [], [], sample.lenses
    steps = np.linspace(sample.looked, sample.done([]), REFERENCE_PARTS + 1).tolist()
    for part in range(REFERENCE_PARTS):
        report(f"reference of {len(lenses)} lenses, part {part + 1} of {REFERENCE_PARTS}", *steps[part:part + 2])
        quarters, frame = renders.reference(part, question.options.reference_spp, lenses)
        files += quarters
        frames.append(frame)
    reference = SampledReference.read(files, frames[0], len(lenses))
    _check_exposure(reference)
    return reference


def _check_exposure(reference: SampledReference) -> None:
    """LfsrError where the picture is almost black or white: then every candidate is perfect, and none of use."""
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
        share=renders.samples / samples_of(costliest, question.display),
        share_of_seconds=renders.seconds / seconds, cost_ratio=sample.budget.quick.cost_ratio,
        within_budget=math.isfinite(sample.limit), reference_noise=measured.reference.noise,
        largest_gain=max((scores.gain for scores in measured.scores.values()), default=0.0))
