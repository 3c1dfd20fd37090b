"""Scores of candidates while a plan is made, and what follows from them."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.frame import Frame
from lfsr_core.frames.request import Request
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.candidates import BETWEEN, Candidate, Rated, between, choose, samples_of
from lfsr_core.plan.estimate import Estimate, Stratum, estimate
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.sample import STRATA, Budget, Lens
from lfsr_core.plan.score import QuickLook, Scores
from lfsr_core.plan.sequential import Group, Known, certainty
from lfsr_core.plan.times import TimeModel


@dataclasses.dataclass(frozen=True)
class Question:
    """What to plan for."""

    job: Request  # scene, display and frame; its scale, samples and output are ignored
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

    @property
    def groups(self) -> set[Group]:
        """Scales and samples of the candidates."""
        return {(candidate.scale, candidate.spp) for candidate in self.wanted}

    def of(self, group: Group) -> list[Candidate]:
        """Candidates of one scale and sample count."""
        return [candidate for candidate in self.wanted if (candidate.scale, candidate.spp) == group]


@dataclasses.dataclass(frozen=True)
class LensSample:
    """The lenses that may be sampled, look by look."""

    look: QuickLook
    frame: Frame  # of the quick look's render
    added: list[dict[str, list[Lens]]]  # lenses that each look adds, by name of STRATA
    budget: Budget
    limit: float  # most path samples, infinite where the number of lenses was given
    is_least: bool  # whether fewest lenses exceed the budget already: a first look is then taken whatever it costs

    def lenses(self, number: int) -> list[Lens]:
        """Lenses that look ``number`` adds, in the order of STRATA."""
        return [lens for name in STRATA for lens in self.added[number][name]]

    @property
    def count(self) -> int:
        """Number of lenses after the last look."""
        return sum(len(self.lenses(number)) for number in range(len(self.added)))

    def cost(self, looks: Mapping[Group, int]) -> float:
        """Path samples spent after so many looks at each group."""
        spent, last = self.budget.quick, max(looks.values(), default=0)
        return spent + sum(self.budget.cost(len(self.lenses(number)), [group for group, taken in looks.items()
                                                                      if taken > number]) for number in range(last))


class Measurements:
    """Scores of candidates; ``add`` takes those of another look."""

    def __init__(self, question: Question, sample: LensSample, model: TimeModel) -> None:
        self.question, self.sample, self.model = question, sample, model
        self.scores: dict[Candidate, Scores] = {}
        self.looks = dict.fromkeys(question.groups, 0)
        self.hits: list[Array] = []  # (n,) bool for each look: lenses whose reference shows any foreground
        self._notes: dict[Candidate, str] = {}

    def add(self, group: Group, found: Mapping[Candidate, Scores], failed: Mapping[Candidate, str]) -> None:
        """Take the scores of the next look at a group; ``failed``: why candidates have none."""
        self._notes |= failed
        for candidate, scores in found.items():
            self.scores[candidate] = self.scores[candidate] + scores if candidate in self.scores else scores
        self.looks[group] += 1

    def next_group(self) -> Group | None:
        """The group to look at next, None where the choice is certain or nothing more can be learned."""
        options = self.question.options
        return Known(self.rated(), self.looks, self._narrowing, options.target, options.limit,
                     self._affords).next_group()

    def rated(self) -> list[Rated]:
        """All candidates as known so far, cheapest first."""
        display = self.question.display
        found = [(candidate, self.scores[candidate].values if candidate in self.scores else None,
                  self._notes.get(candidate, "")) for candidate in self.question.wanted]
        found += [(candidate, values, BETWEEN) for candidate, values in self._between()]
        rows = [Rated(**vars(candidate), seconds=self.model.seconds(candidate, display), note=note,
                      estimate=None if values is None else self._estimate(values)) for candidate, values, note in found]
        return sorted(rows, key=lambda row: row.seconds)

    def explained(self) -> list[Rated]:
        """All candidates once the choice is made, with a note where one was not measured."""
        rows, options = self.rated(), self.question.options
        chosen = choose(rows, options.target, options.limit).chosen
        return [row if row.estimate or row.note else dataclasses.replace(row, note=self._why_not(row, chosen))
                for row in rows]

    def _why_not(self, row: Rated, chosen: Rated | None) -> str:
        """Reason why a candidate was not measured."""
        if row.seconds > self.question.options.limit:
            return "takes too long"
        if chosen and row.seconds > chosen.seconds:
            return f"not needed: costs more than {chosen.name}"
        return "not measured: beyond the sample's budget (--budget)"

    def _narrowing(self, lenses: int) -> float:
        """Return by what factor bounds from the first ``lenses`` narrow with those of all looks, 0 if none is left.

        They narrow with the root of 1 / count - 1 / population, in lenses that count for the metric.
        """
        names, sample = STRATA if self.question.every_lens else STRATA[:1], self.sample
        counts = itertools.accumulate(sum(len(added[name]) for name in names) for added in sample.added)
        sizes = itertools.accumulate(len(sample.lenses(number)) for number in range(len(sample.added)))
        population = sum(int(sample.look.masks[name].sum()) for name in names)
        variances = {size: max(1 / count - 1 / population, 0.0) for size, count in zip(sizes, counts, strict=True)}
        now, last = variances[lenses], min(variances.values())
        return math.sqrt(last / now) if now > 0 else 0.0

    def _affords(self, group: Group) -> bool:
        """Whether another look at a group is possible."""
        looks = {**self.looks, group: self.looks[group] + 1}
        if looks[group] > len(self.sample.added):
            return False
        return self.sample.cost(looks) <= self.sample.limit or (looks[group] == 1 and self.sample.is_least)

    def _between(self) -> Iterator[tuple[Candidate, Array]]:
        """Candidates between measured ones, with the accuracy (n,) of each lens that both have."""
        for scale, method in sorted({(candidate.scale, candidate.method) for candidate in self.scores}):
            known = {candidate.spp: scores.values for candidate, scores in self.scores.items()
                     if (candidate.scale, candidate.method) == (scale, method)}
            for spp, fewer, more, weight in between(list(known), self.question.options.between):
                count = min(len(known[fewer]), len(known[more]))
                yield (Candidate(scale, spp, method),
                       (1 - weight) * known[fewer][:count] + weight * known[more][:count])

    def _estimate(self, of_lenses: Array) -> Estimate:
        """Estimate over the display from the accuracy (n,) of the lenses of the first looks."""
        lenses: list[tuple[str, Lens]] = []
        hits, strata = [], []
        for number, added in enumerate(self.sample.added):
            if len(lenses) < len(of_lenses):
                lenses += [(name, lens) for name in STRATA for lens in added[name]]
                hits.append(self.hits[number])
        names, seen = np.array([name for name, _ in lenses]), np.concatenate(hits)
        look, every = self.sample.look, self.question.every_lens
        for name in STRATA if every else STRATA[:-1]:
            rows = names == name
            inside = seen[rows] if name == "edge" and not every else np.ones(int(rows.sum()), bool)
            covariates = look.covariates(name, [lens for own, lens in lenses if own == name])
            strata.append(Stratum(int(look.masks[name].sum()), of_lenses[rows], inside, *covariates))
        return estimate(strata, certainty(len(self.sample.added)))
