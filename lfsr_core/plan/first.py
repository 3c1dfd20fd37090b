"""Before a plan has measured anything: what it may cost, and a first guess from the depth of the scene."""

from __future__ import annotations

import dataclasses

from lfsr_core.base.arrays import Array
from lfsr_core.optics.depth_scale import MODEL
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.candidates import Candidate, samples_of
from lfsr_core.plan.options import FREE_SAMPLES, PlanOptions


def most_paths(display: DisplayProfile, options: PlanOptions) -> float:
    """Return the most path samples that a plan may take, unless the fewest lenses take more."""
    costliest = max(samples_of(candidate, display) for candidate in options.candidates(display))
    return max(options.budget * costliest, FREE_SAMPLES)


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
    loss = {candidate: MODEL.loss(moves, candidate.scale, candidate.spp) for candidate in found}
    enough = [candidate for candidate in found if loss[candidate] <= 1 - options.target]
    # Candidates come in the order of their cost.
    chosen = enough[0] if enough else min(found, key=loss.__getitem__)
    best = max((candidate for candidate in found if (candidate.scale, candidate.spp) == (chosen.scale, chosen.spp)),
               key=lambda candidate: candidate.steps)
    return Guess(best, bool(enough))
