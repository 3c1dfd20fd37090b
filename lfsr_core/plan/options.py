"""What to plan for."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.candidates import METRICS, SAMPLES, Candidate, candidates


@dataclasses.dataclass(frozen=True)
class PlanOptions:
    """Target, candidates, and what the sample may cost; LfsrError for what cannot be."""

    target: float = 0.95  # accuracy to reach, in (0, 1)
    metric: str = METRICS[0]  # one of METRICS
    # scales, spps, methods: as for ``candidates``
    scales: tuple[int, ...] | None = None
    spps: tuple[int, ...] = SAMPLES
    methods: tuple[str, ...] | None = None
    # of those candidates only these pairs of scale and samples, None for all
    renders: tuple[tuple[int, int], ...] | None = None
    between: int = 3  # sample counts judged between each two that are measured
    most_seconds: float | None = None  # longest time of a frame, None for any
    share: float = 0.05  # of the costliest candidate's path samples that the sample may take
    lenses: int | None = None  # sample just so many instead
    reference_spp: int = 256  # samples per pixel of the sampled lenses' reference

    def __post_init__(self) -> None:
        if not 0 < self.target < 1:
            raise LfsrError(f"target is {self.target}, but an accuracy lies between 0 and 1, as 0.95")
        if self.metric not in METRICS:
            raise LfsrError(f"metric is {self.metric!r}, but a plan looks at single lenses: choose "
                            f"{' or '.join(METRICS)}")
        if not 0 < self.share <= 1:
            raise LfsrError(f"budget is {self.share}, but it must be a share above 0 and at most 1")
        if self.lenses is not None and self.lenses < 4:
            raise LfsrError(f"number of lenses is {self.lenses}, but a plan needs at least 4 to know how sure it is")
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
        """What is wanted of ``display``; LfsrError as of ``candidates``, and where nothing is left."""
        found = candidates(display, self.scales, self.spps, self.methods)
        if self.renders is not None:
            found = [candidate for candidate in found if (candidate.scale, candidate.spp) in self.renders]
        if not found:
            raise LfsrError(f"no candidate is among the renders {self.renders}: name others")
        return found
