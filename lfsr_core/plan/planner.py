"""The plan, step by step: render a sample of lenses and measure every candidate on it."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, write_json
from lfsr_core.base.progress import Progress, silent
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS
from lfsr_core.frames.request import Request
from lfsr_core.images.exposure import extreme_tone
from lfsr_core.images.exr import read_finite
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.plan import sample as plan_sample
from lfsr_core.plan.candidates import Candidate, Choice, Rated, choose, low_pixels, samples_of
from lfsr_core.plan.measurements import LensSample, Measurements, Question
from lfsr_core.plan.options import FREE_SAMPLES, PlanOptions
from lfsr_core.plan.renders import REFERENCE_PARTS, Moving, SampleRenders
from lfsr_core.plan.sample import STRATA, Mosaic, reach, with_neighbours
from lfsr_core.plan.score import QuickLook, SampledReference, Scores, quick_look, score, stage_time
from lfsr_core.plan.sequential import Group
from lfsr_core.plan.times import StageTime, TimeModel, path_samples, render_seconds
from lfsr_core.plan.work import sample_facts

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


def make_plan(job: Request, options: PlanOptions, render: Callable[[Request, Progress], None], folder: str | Path,
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
    job = job.with_scale(ScaleChoice(1))
    question = Question(job, options, tuple(options.candidates(job.display)))
    if job.layout in ("view-by-view", SUBPIXELS):
        raise LfsrError(f"a plan renders single lenses, which the layout {job.layout} cannot: choose another layout")
    _check_sample(Path(folder), question)

    report = Moving(progress)
    renders = SampleRenders(Path(folder), job, lambda job: render(job, report.rendering))
    sample, model = _sample(question, renders, report)
    looking = Looking(question, sample, renders, model, report)
    while (group := looking.measured.next_group()) is not None:
        looking.look(group)
    rated = tuple(looking.measured.explained())
    return Planned(rated, choose(rated, options.target, options.limit), looking.facts())


class Looking:
    """Renders and measures the candidates of a plan, group by group and look by look."""

    def __init__(self, question: Question, sample: LensSample, renders: SampleRenders, model: TimeModel,
                 report: Moving) -> None:
        self.measured = Measurements(question, sample, model)
        self.references: list[SampledReference] = []
        self.seconds = 0.0  # of second stages
        self._renders, self._model, self._report = renders, model, report
        self._stages = dict[tuple[int, str], StageTime]()
        self._so_far = ""  # the choice that the looks before have led to

    def look(self, group: Group) -> None:
        """Render the lenses of the next look at one scale and sample count, and measure every candidate on them."""
        measured, sample, (scale, spp) = self.measured, self.measured.sample, group
        number = measured.looks[group]
        if number == len(self.references):
            self._render_reference(number)
        lenses, display = sample.lenses(number), measured.question.display
        width = reach(display, scale)
        listed, blocks = with_neighbours(lenses, width, display.lenses)
        spent = sample.cost({**measured.looks, group: number + 1})
        self._tell(f"{self._lenses(number)}{' and their neighbours' if width else ''} at scale {scale}, {spp} samples",
                   spent - sample.budget.cost(len(lenses), [group], reference=False), spent)
        folder = self._renders.sampled(number, scale, spp, listed)
        read_finite(folder / LOW_RES_FILE)  # where it is damaged, no method is to blame
        started = time.perf_counter()
        self._measure(group, folder, blocks, spent)
        self.seconds += time.perf_counter() - started
        measured.model = self._times()
        options = measured.question.options
        chosen = choose(measured.rated(), options.target, options.limit).chosen
        self._so_far = f"scale {chosen.scale} with {chosen.spp} samples so far; " if chosen else ""

    def _measure(self, group: Group, folder: Path, blocks: Array, spent: float) -> None:
        """Measure a group's candidates on the render of ``blocks`` of lenses in ``folder``."""
        measured = self.measured
        here, number = measured.question.of(group), measured.looks[group]
        scores: dict[Candidate, Scores] = {}
        failed: dict[Candidate, str] = {}
        for candidate in here:
            self._tell(f"{candidate.name}: {here.index(candidate) + 1} of {len(here)} methods", spent)
            try:
                scores[candidate] = score(folder, candidate.method, Mosaic.of(blocks), self.references[number])
                if not number:
                    self._stages[candidate.scale, candidate.method] = stage_time(
                        folder, candidate.method, Mosaic.of(blocks), Mosaic.of(blocks[:1]))
            except LfsrError as error:
                failed[candidate] = str(error)
        measured.add(group, scores, failed)

    def _render_reference(self, number: int) -> None:
        """Render the lenses that a look adds at full resolution, in four independent quarters."""
        measured, files, frames = self.measured, [], []
        lenses, spent = measured.sample.lenses(number), measured.sample.cost(measured.looks)
        step = measured.sample.budget.cost(len(lenses), []) / REFERENCE_PARTS
        for part in range(REFERENCE_PARTS):
            self._tell(f"reference of {self._lenses(number)}, part {part + 1} of {REFERENCE_PARTS}",
                       spent + part * step, spent + (part + 1) * step)
            quarters, frame = self._renders.reference(number, part, measured.question.options.reference_spp, lenses)
            files += quarters
            frames.append(frame)
        self.references.append(SampledReference.read(files, frames[0], len(lenses)))
        _check_exposure(self.references[-1])
        measured.hits.append(self.references[-1].hits)

    def _lenses(self, number: int) -> str:
        """The lenses of a look in words."""
        sample = self.measured.sample
        if len(sample.added) == 1:
            return f"{sample.count} lenses"
        return f"{len(sample.lenses(number))} lenses of at most {sample.count}"

    def _tell(self, message: str, spent: float, until: float | None = None) -> None:
        """Show the progress: path samples ``spent``, and those at the end of the render that begins."""
        sample = self.measured.sample
        one, all_ = (sample.cost(dict.fromkeys(self.measured.looks, looks)) for looks in (1, len(sample.added)))
        whole = min(max(sample.limit, one), all_)
        self._report(f"{self._so_far}{message}", spent / whole, None if until is None else until / whole)

    def _times(self) -> TimeModel:
        """Time model of all renders so far."""
        sample, model = self.measured.sample, dataclasses.replace(self._model, stages=dict(self._stages))
        fraction = float(sample.look.masks["foreground"].mean())
        return model.refined(sample.frame, self._renders.of_lenses, fraction)

    def facts(self) -> SampleFacts:
        """The sample and its cost, when the plan is made."""
        measured, renders, sample = self.measured, self._renders, self.measured.sample
        question, used = measured.question, sample.added[:len(self.references)]
        costliest = question.costliest
        seconds = measured.model.seconds(costliest, question.display)
        return SampleFacts(
            lenses={name: sum(len(added[name]) for added in used) for name in STRATA},
            foreground=int(sample.look.masks["foreground"].sum()), costliest=costliest.name, costliest_seconds=seconds,
            seconds=renders.seconds, measuring_seconds=self.seconds,
            fraction=renders.samples / samples_of(costliest, question.display),
            fraction_of_seconds=renders.seconds / seconds, cost_ratio=sample.budget.cost_ratio,
            within_budget=math.isfinite(sample.limit) and not sample.is_least,
            reference_noise=max(reference.noise for reference in self.references),
            largest_gain=max((scores.gain for scores in measured.scores.values()), default=0.0))


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
                                _cost_ratio(question, renders, look, model.per_sample), options.budget,
                                FREE_SAMPLES)
    counts = (options.lenses,) if options.lenses else plan_sample.looks(plan_sample.LEAST_LENSES, budget.lenses)
    added = plan_sample.samples(look.masks, counts, question.job.seed, question.every_lens)
    return LensSample(look, frame, added, budget, math.inf if options.lenses else budget.allowed,
                      budget.lenses <= plan_sample.LEAST_LENSES), model


def _cost_ratio(question: Question, renders: SampleRenders, look: QuickLook, per_sample: float) -> float:
    """Cost of a path sample in a foreground lens relative to one in the mean lens, from a few lenses."""
    mask = look.masks["foreground"]
    masks = {**look.masks, "edge": np.zeros_like(mask)}
    (few,) = plan_sample.samples(masks, (PILOT_LENSES,), question.job.seed, False)
    pilot = renders.pilot(few["foreground"])
    ratio = render_seconds(pilot) / path_samples(pilot) / per_sample
    # If the other lenses cost nothing, it is the inverse of the foreground's fraction; more would be set-up.
    return float(np.clip(ratio, 1, mask.size / mask.sum()))


def _check_exposure(reference: SampledReference) -> None:
    """LfsrError if the image is almost black or white: every candidate would be perfect."""
    tone = extreme_tone(srgb_encode(np.mean(reference.quarters, 0)[reference.hits]))
    if tone:
        change = "stronger" if tone == "black" else "weaker"
        raise LfsrError(f"the sampled lenses are almost {tone}, so that every setting would seem perfect: make the "
                        f"scene's lights {change}, or check where the camera looks")
