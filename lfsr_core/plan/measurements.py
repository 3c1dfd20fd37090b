"""Scores and times of candidates while a plan is made, and the decision which to render."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import Frame
from lfsr_core.frames.job import Job
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.candidates import BETWEEN, Candidate, Rated, between, choose, samples_of
from lfsr_core.plan.estimate import Estimate, Stratum, estimate
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.renders import Moving, SampleRenders
from lfsr_core.plan.sample import STRATA, Budget, Lens, Mosaic, reach, with_neighbours
from lfsr_core.plan.score import QuickLook, SampledReference, Scores, score, stage_time
from lfsr_core.plan.times import StageTime, TimeModel


@dataclasses.dataclass(frozen=True)
class Question:
    """What to plan for."""

    job: Job  # scene, display and frame; its scale, samples and output are ignored
    options: PlanOptions
    wanted: tuple[Candidate, ...]  # the candidates, cheapest render first

    @property
    def display(self) -> DisplayProfile:
        """The display to plan for."""
        return self.job.display

    @property
    def every_lens(self) -> bool:
        """Whether the metric counts every lens, not only those of the foreground."""
        return self.options.metric == "ssim_lens"

    @property
    def costliest(self) -> Candidate:
        """The candidate whose frame takes the most path samples."""
        return max(self.wanted, key=lambda candidate: samples_of(candidate, self.display))


@dataclasses.dataclass(frozen=True)
class LensSample:
    """The sampled lenses."""

    look: QuickLook
    frame: Frame  # of the quick look's render
    strata: dict[str, list[Lens]]  # sampled lenses by name of STRATA
    budget: Budget
    limit: float  # most path samples, infinite where the number of lenses was given

    @property
    def lenses(self) -> list[Lens]:
        """All sampled lenses, in the order of STRATA."""
        return [lens for name in STRATA for lens in self.strata[name]]

    def done(self, renders: list[tuple[int, int]] | None) -> float:
        """Fraction of the sample's cost spent after these renders, by (scale, spp); None: after the quick look."""
        spent = self.budget.quick if renders is None else self._cost(renders)
        return spent / self._cost(self.budget.renders)

    def affords(self, renders: list[tuple[int, int]]) -> bool:
        """Whether these renders are within the limit."""
        return self._cost(renders) <= self.limit

    def _cost(self, renders: Iterable[tuple[int, int]]) -> float:
        return self.budget.cost(len(self.lenses), renders)


class Measurements:
    """Scores and times of candidates; ``measure`` adds those of one scale and sample count."""

    def __init__(self, question: Question, sample: LensSample, reference: SampledReference, renders: SampleRenders,
                 model: TimeModel) -> None:
        self.question, self.sample, self.reference, self.renders = question, sample, reference, renders
        self.scores: dict[Candidate, Scores] = {}
        self.seconds = 0.0
        self._model, self._stages = model, dict[tuple[int, str], StageTime]()
        self._notes: dict[Candidate, str] = {}
        self._measured: list[tuple[int, int]] = []

    def measure(self, scale: int, spp: int, report: Moving) -> None:
        """Render and measure the candidates of one scale and sample count, or note why not."""
        here = [c for c in self.question.wanted if (c.scale, c.spp) == (scale, spp)]
        why = self._why_not(scale, spp, here)
        if why:
            self._notes |= dict.fromkeys(here, why)
            return
        width = reach(self.question.display, scale)
        listed, blocks = with_neighbours(self.sample.lenses, width, self.question.display.lenses)
        beside = " and their neighbours" if width else ""
        report(f"{len(self.sample.lenses)} lenses{beside} at scale {scale}, {spp} samples",
               self.sample.done(self._measured), self.sample.done([*self._measured, (scale, spp)]))
        folder = self.renders.sampled(scale, spp, listed)
        self._measured.append((scale, spp))
        started = time.perf_counter()
        for candidate in here:
            report(f"{candidate.name}: {here.index(candidate) + 1} of {len(here)} methods",
                   self.sample.done(self._measured))
            self._score(candidate, folder, Mosaic.of(blocks), Mosaic.of(blocks[:1]))
        self.seconds += time.perf_counter() - started

    def rated(self) -> list[Rated]:
        """All candidates as known so far, cheapest first."""
        times, display = self.times(), self.question.display
        found = [(candidate, self.scores[candidate].values if candidate in self.scores else None,
                  self._notes.get(candidate, "")) for candidate in self.question.wanted]
        found += [(candidate, values, BETWEEN) for candidate, values in self._between()]
        rows = [Rated(**vars(candidate), seconds=times.seconds(candidate, display), note=note,
                      estimate=None if values is None else self._estimate(values)) for candidate, values, note in found]
        return sorted(rows, key=lambda row: row.seconds)

    def times(self) -> TimeModel:
        """Time model of all renders so far."""
        model = dataclasses.replace(self._model, stages=self._stages)
        fraction = float(self.sample.look.masks["foreground"].mean())
        return model.refined(self.sample.frame, self.renders.of_lenses, fraction)

    def _why_not(self, scale: int, spp: int, here: list[Candidate]) -> str:
        """Reason not to measure the candidates of one scale and sample count, empty if there is none."""
        options, times = self.question.options, self.times()
        least = min(times.seconds(candidate, self.question.display) for candidate in here)
        if least > options.limit:
            return "takes too long"
        chosen = choose(self.rated(), options.target, options.limit).chosen
        confirms = chosen and chosen.scale == scale and all(
            spp <= other for key, other in self.sample.budget.renders
            if key == scale and other > chosen.spp)
        if chosen and least > chosen.seconds and not confirms:
            return f"not needed: costs more than {chosen.name}"
        if not self.sample.affords([*self._measured, (scale, spp)]):
            return "not measured: beyond the sample's budget (--budget)"
        return ""

    def _score(self, candidate: Candidate, folder: Path, mosaic: Mosaic, one: Mosaic) -> None:
        try:
            self.scores[candidate] = score(folder, candidate.method, mosaic, self.reference)
            stage = stage_time(folder, candidate.method, mosaic, one)
        except LfsrError as error:
            self._notes[candidate] = str(error)
            return
        self._stages[candidate.scale, candidate.method] = stage

    def _between(self) -> Iterator[tuple[Candidate, Array]]:
        """Candidates between measured ones, with the accuracy (n,) of each sampled lens."""
        for scale, method in sorted({(candidate.scale, candidate.method) for candidate in self.scores}):
            known = {candidate.spp: scores.values for candidate, scores in self.scores.items()
                     if (candidate.scale, candidate.method) == (scale, method)}
            for spp, fewer, more, weight in between(list(known), self.question.options.between):
                yield Candidate(scale, spp, method), (1 - weight) * known[fewer] + weight * known[more]

    def _estimate(self, of_lenses: Array) -> Estimate:
        """Estimate over the display from the accuracy (n,) of every sampled lens."""
        look, every, strata, start = self.sample.look, self.question.every_lens, [], 0
        for name in STRATA:
            lenses = self.sample.strata[name]
            rows = slice(start, start + len(lenses))
            start = rows.stop
            if name == "rest" and not every:
                continue
            values = of_lenses[rows]
            inside = np.ones(len(values), bool) if every or name == "foreground" else self.reference.hits[rows]
            strata.append(Stratum(int(look.masks[name].sum()), values, inside, *look.covariates(name, lenses)))
        return estimate(strata)
