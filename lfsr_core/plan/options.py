"""Options of a plan."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.candidates import METRICS, SAMPLES, Candidate, candidates

FREE_SAMPLES = 10**8  # path samples, a minute or two of most scenes, that a plan may take beyond its budget


@dataclasses.dataclass(frozen=True)
class PlanOptions:
    """Target, candidates, and cost of the sample; LfsrError for impossible values."""

    target: float = 0.95  # accuracy to reach, in (0, 1)
    metric: str = METRICS[0]  # one of METRICS
    # scales, spps, methods, rays: as for ``candidates``
    scales: tuple[int, ...] | None = None
    spps: tuple[int, ...] = SAMPLES
    methods: tuple[str, ...] | None = None
    rays: tuple[float, ...] | None = None
    # only these (scale, samples) of those candidates, None for all
    renders: tuple[tuple[int, int], ...] | None = None
    between: int = 3  # sample counts to estimate between each two that are measured
    most_seconds: float | None = None  # longest time of a frame, None for any
    # most that the sample may cost, as a fraction of the path samples of the costliest candidate's frame
    budget: float = dataclasses.field(default=0.05, metadata={"key": "share"})
    lenses: int | None = None  # number of lenses to sample, whatever the budget; None for as many as it takes
    reference_spp: int = 256  # samples per pixel of the sampled lenses' reference

    def __post_init__(self) -> None:
        if not 0 < self.target < 1:
            raise LfsrError(f"target is {self.target}, but an accuracy lies between 0 and 1, as 0.95")
        if self.metric not in METRICS:
            raise LfsrError(f"metric is {self.metric!r}, but a plan looks at single lenses: choose "
                            f"{' or '.join(METRICS)}")
        if not 0 < self.budget <= 1:
            raise LfsrError(f"budget is {self.budget}, but it must be a fraction above 0 and at most 1")
        if self.lenses is not None and self.lenses < 4:
            raise LfsrError(f"number of lenses is {self.lenses}, but a plan needs at least 4 to estimate its certainty")
        if self.reference_spp < 4:
            raise LfsrError(f"reference samples are {self.reference_spp}, but its four quarters need at least 4")
        if self.between < 0:
            raise LfsrError(f"between is {self.between}, but it must be 0 or more sample counts")
        if not self.limit > 0:
            raise LfsrError(f"seconds are {self.most_seconds}, but a frame takes more than 0")

    @property
    def limit(self) -> float:
        """Longest time of a frame in seconds, infinite where any will do."""
        return math.inf if self.most_seconds is None else self.most_seconds

    def candidates(self, display: DisplayProfile) -> list[Candidate]:
        """Candidates for ``display``, cheapest render first; LfsrError as of ``candidates``, or if none is left."""
        found = candidates(display, self.scales, self.spps, self.methods, self.rays)
        if self.renders is not None:
            found = [candidate for candidate in found if (candidate.scale, candidate.spp) in self.renders]
        if not found:
            raise LfsrError(f"no candidate is among the renders {self.renders}: name others")
        return found
