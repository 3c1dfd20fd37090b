"""Records of a validation of plans, as stored in its file."""

from __future__ import annotations

import dataclasses
from typing import Any


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
