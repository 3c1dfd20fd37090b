"""What a validation of plans says, as it is kept in a file."""

from __future__ import annotations

import dataclasses

from lfsr_core.plan.planner import SampleFacts


@dataclasses.dataclass(frozen=True)
class Verdict:
    """How a plan compares with whole frames.

    Attributes
    ----------
    scene, seed, target : which plan
    chosen : name of the chosen candidate, None where nothing met the target
    hindsight : the cheapest candidate that meets the target as a whole frame, None where none does
    met : whether the chosen one does; None without one, like all that follow
    cost : seconds of the chosen one over those of the one in hindsight, where the target is met
    samples : the same of path samples
    sample : what was looked at
    limit : why nothing was chosen
    covered : for each measured candidate, whether its lower bound holds
    errors : for each, its estimate minus its accuracy as a whole frame
    times : for each, predicted over actual seconds
    estimate, bound : of the chosen one
    actual : its accuracy as a whole frame
    """

    scene: str
    seed: int
    target: float
    chosen: str | None
    hindsight: str | None
    met: bool | None
    cost: float | None
    samples: float | None
    sample: SampleFacts
    limit: str
    covered: tuple[bool, ...]
    errors: tuple[float, ...]
    times: tuple[float, ...]
    estimate: float | None = None
    bound: float | None = None
    actual: float | None = None


@dataclasses.dataclass(frozen=True)
class Summary:
    """Over all plans: how often the target was met, what it cost, and how good the estimates were.

    Attributes
    ----------
    plans, chosen : plans, and those that chose a candidate
    met : share of these whose candidate meets the target
    nothing_chosen_though_possible : plans that chose none although one meets the target
    costs : plans whose cost is known, as Verdict.cost
    median_cost, cheap_enough : of these costs the median, and the share of at most validation.CHEAP_ENOUGH
    bounds_below_actual : share of all lower bounds that hold
    mean_error : of all estimates
    median_predicted_over_actual_seconds : of all candidates
    mean_share_of_seconds, mean_share_of_samples : of a sample in the costliest candidate's frame
    """

    plans: int
    chosen: int
    met: float | None
    nothing_chosen_though_possible: int
    costs: int
    median_cost: float | None
    cheap_enough: float | None
    bounds_below_actual: float | None
    mean_error: float | None
    median_predicted_over_actual_seconds: float | None
    mean_share_of_seconds: float | None
    mean_share_of_samples: float | None


@dataclasses.dataclass(frozen=True)
class Validation:
    """The file of a validation: whether renders were replayed, its ``summary`` and all ``plans``."""

    replay: bool
    summary: Summary
    plans: tuple[Verdict, ...]
