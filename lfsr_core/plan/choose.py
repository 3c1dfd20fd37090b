"""The cheapest candidate whose accuracy reaches the target, or what it is that keeps all from it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.metrics.eia_metrics import stratum
from lfsr_core.optics.depth_scale import MODEL
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.options import Candidate, PlanOptions

AS_GOOD = 1.05  # ratio of times within which candidates count as equally cheap: the simpler method is taken


@dataclasses.dataclass(frozen=True)
class Estimate:
    """Accuracy of a whole frame, from a sample of its lenses."""

    mean: float  # over all lenses that count
    low: float  # lower end of its 95 % interval
    lenses: int  # number of sampled lenses that count


@dataclasses.dataclass(frozen=True)
class Rated(Candidate):
    """A candidate with its predicted time and its accuracy."""

    seconds: float  # predicted for a whole frame
    estimate: Estimate | None = None  # accuracy, None where it was not measured
    unmeasured: Notice | None = None  # why it was not

    @property
    def candidate(self) -> Candidate:
        """The candidate alone."""
        return Candidate(self.scale, self.samples, self.method)

    @property
    def low(self) -> float:
        """Lower bound of the accuracy, -inf where it was not measured."""
        return -math.inf if self.estimate is None else self.estimate.low


@dataclasses.dataclass(frozen=True)
class Choice:
    """The outcome of a plan."""

    chosen: Rated | None  # the cheapest that reaches the target with confidence, None if there is none
    best: Rated | None  # the measured candidate with the highest lower bound, None if none was measured
    limit: Notice | None = None  # what keeps every candidate from the target


def estimate(values: Array, counts: Array, population: int) -> Estimate:
    """Estimate the accuracy of a frame from the ``values`` (n,) of lenses drawn at random from ``population``.

    ``counts`` (n,) bool: those that count for the metric, about as many of the population as of the sample. LfsrError
    where fewer than two do, so that nothing is known of their spread.
    """
    count = int(counts.sum())
    mean, width = stratum(values[counts], round(population * count / len(values)))
    if mean is None or width is None:
        raise LfsrError(f"{count} of {len(values)} sampled lenses shows foreground, but at least 2 are needed: choose "
                        "another subject, more lenses, or metric ssim_lens")
    return Estimate(mean, mean - width, count)


def choose(rated: Sequence[Rated], target: float, most_seconds: float = math.inf) -> Choice:
    """Choose the cheapest candidate whose lower bound reaches ``target`` in at most ``most_seconds``.

    Of candidates that are equally cheap (AS_GOOD) the simplest is taken.
    """
    measured = [row for row in rated if row.estimate is not None and row.seconds <= most_seconds]
    best = max(measured, key=lambda row: row.low, default=None)
    passing = [row for row in measured if row.low >= target]
    if passing:
        least = min(row.seconds for row in passing)
        near = [row for row in passing if row.seconds <= AS_GOOD * least]
        return Choice(min(near, key=lambda row: (row.steps, row.seconds)), best)
    # What keeps the best candidate from the target.
    if any(row.low >= target and row.seconds > most_seconds for row in rated):
        return Choice(None, best, Notice("plan-limit-time", {"seconds": most_seconds}))
    if best is None or best.estimate is None:
        return Choice(None, best, Notice("plan-limit-unmeasured"))
    if best.estimate.mean >= target:
        return Choice(None, best, Notice("plan-limit-certainty", {"lenses": best.estimate.lenses}))
    means = {row.samples: row.estimate.mean for row in rated
             if row.estimate is not None and (row.scale, row.method) == (best.scale, best.method)}
    *_, before, last = (best.estimate.mean, *(means[samples] for samples in sorted(means)))
    if last + (last - before) >= target:  # each further step of samples gains about half of the one before it
        return Choice(None, best, Notice("plan-limit-noise", {"samples": best.samples}))
    return Choice(None, best, Notice("plan-limit-upscaling" if best.scale > 1 else "plan-limit-method",
                                     {"scale": best.scale}))


@dataclasses.dataclass(frozen=True)
class Guess:
    """A candidate that was not measured."""

    candidate: Candidate
    reaches: bool  # whether it is predicted to reach the target


def first_guess(display: DisplayProfile, moves: Array, options: PlanOptions) -> Guess:
    """Return the cheapest candidate that is predicted to reach the target, else the one predicted to lose least.

    ``moves`` (n,): disparities of points of the subject, as of ``optics.depth_scale.disparities``. Of the methods at
    one scale and sample count, which the model does not tell apart, the one with most steps is taken.
    """
    found = options.candidates(display)
    loss = {candidate: MODEL.loss(moves, candidate.scale, candidate.samples) for candidate in found}
    enough = [candidate for candidate in found if loss[candidate] <= 1 - options.target]
    chosen = enough[0] if enough else min(found, key=loss.__getitem__)
    same = [each for each in found if (each.scale, each.samples) == (chosen.scale, chosen.samples)]
    return Guess(max(same, key=lambda candidate: candidate.steps), bool(enough))
