"""What to plan for."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan import candidates as plan
from lfsr_core.plan.candidates import Candidate


@dataclasses.dataclass(frozen=True)
class Options:
    """Target, candidates, and what the sample may cost.

    ``target``: accuracy by ``metric`` of plan.METRICS, in (0, 1). ``scales``,
    ``spps``, ``methods``: as for ``plan.candidates``; ``renders``: of those only
    these pairs of scale and samples; ``between``: sample counts judged between
    each two that are measured. ``most_seconds``: longest
    time of a frame. ``share``: of the dearest candidate's path samples that the
    sample may take. ``lenses``: sample just so many instead. ``reference_spp``:
    of the sampled lenses' reference. LfsrError for what cannot be.
    """

    target: float = 0.95
    metric: str = plan.METRICS[0]
    scales: tuple[int, ...] | None = None
    spps: tuple[int, ...] = plan.SAMPLES
    methods: tuple[str, ...] | None = None
    renders: tuple[tuple[int, int], ...] | None = None
    between: int = 3
    most_seconds: float = math.inf
    share: float = 0.05
    lenses: int | None = None
    reference_spp: int = 256

    def __post_init__(self) -> None:
        if not 0 < self.target < 1:
            raise LfsrError(f"target is {self.target}, but an accuracy lies between 0 and 1, as 0.95")
        if self.metric not in plan.METRICS:
            raise LfsrError(f"metric is {self.metric!r}, but it must be one of {', '.join(plan.METRICS)}")
        if not 0 < self.share <= 1:
            raise LfsrError(f"budget is {self.share}, but it must be a share above 0 and at most 1")
        if self.lenses is not None and self.lenses < 4:
            raise LfsrError(f"number of lenses is {self.lenses}, but a plan needs at least 4 to know how sure it is")
        if self.reference_spp < 4:
            raise LfsrError(f"reference samples are {self.reference_spp}, but its four quarters need at least 4")
        if self.between < 0:
            raise LfsrError(f"between is {self.between}, but it must be 0 or more sample counts")
        if not self.most_seconds > 0:
            raise LfsrError(f"seconds are {self.most_seconds}, but a frame takes more than 0")

    def candidates(self, display: DisplayProfile) -> list[Candidate]:
        """What is wanted of ``display``; LfsrError as of ``plan.candidates``, and where nothing is left."""
        found = plan.candidates(display, self.scales, self.spps, self.methods)
        if self.renders is not None:
            found = [candidate for candidate in found if (candidate.scale, candidate.spp) in self.renders]
        if not found:
            raise LfsrError(f"no candidate is among the renders {self.renders}: name others")
        return found
