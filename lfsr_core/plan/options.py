"""What a plan is asked: the target, the candidates, and what the sample may cost."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import Frame
from lfsr_core.frames.request import samples_at
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, FAST_METHOD, PLAIN_METHOD, MethodName, load_method, oidn

METRICS = ("ssim_lens_fg", "ssim_lens")
SCALES, SAMPLES = (1, 2, 4, 8), (4, 16, 64, 256)
FREE_PATHS = 10**8  # path samples, a minute or two of most scenes, that a plan may take beyond its budget


@dataclasses.dataclass(frozen=True, order=True)
class Candidate:
    """One way to make a frame."""

    # scale, samples: of the render, samples being per pixel
    scale: int
    samples: int
    method: str  # of the second stage

    @property
    def name(self) -> str:
        """Short name, as in "s4-spp16 denoise+bilinear"."""
        return f"s{self.scale}-spp{self.samples} {self.method}"

    @property
    def steps(self) -> int:
        """Number of steps of the method: fewer are simpler."""
        return MethodName.parse(self.method).steps

    def rays(self, display: DisplayProfile) -> float:
        """Rays per finished pixel."""
        return self.samples / display.finished_pixels(self.scale)

    def paths(self, display: DisplayProfile) -> int:
        """Path samples of a whole frame: the measure of a render's cost."""
        return math.prod(display.lenses) * math.prod(display.low_views(self.scale)) * self.samples


@dataclasses.dataclass(frozen=True)
class PlanOptions:
    """Target, candidates, and cost of the sample; LfsrError for impossible values."""

    target: float = 0.95  # accuracy to reach, in (0, 1)
    metric: str = METRICS[0]  # one of METRICS
    scales: tuple[int, ...] | None = None  # None for those of SCALES that divide the views
    samples: tuple[int, ...] = SAMPLES  # per pixel
    methods: tuple[str, ...] | None = None  # None for ``default_methods``
    rays: tuple[float, ...] | None = None  # per finished pixel, instead of ``samples``
    most_seconds: float | None = None  # longest time of a frame, None for any
    # most that the sample may cost, as a fraction of the path samples of the costliest candidate's frame
    budget: float = 0.05
    lenses: int | None = None  # number of lenses to sample, whatever the budget; None for the usual number
    reference_samples: int = 256  # samples per pixel of the sampled lenses' reference

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
        if self.reference_samples < 4:
            raise LfsrError(f"reference samples are {self.reference_samples}, but its four quarters need at least 4")
        if self.most_seconds is not None and not self.most_seconds > 0:
            raise LfsrError(f"seconds are {self.most_seconds}, but a frame takes more than 0")
        for samples in self.samples:
            if type(samples) is not int or samples < 1:
                raise LfsrError(f"samples per pixel is {samples!r}, but a candidate needs a whole number of at least 1")

    @property
    def limit(self) -> float:
        """Longest time of a frame in seconds, infinite where any will do."""
        return math.inf if self.most_seconds is None else self.most_seconds

    def candidates(self, display: DisplayProfile) -> list[Candidate]:
        """Every possible combination for ``display``, cheapest render first.

        LfsrError for a scale that does not divide the views, impossible rays, an unknown method, or if none is left.
        """
        for name in self.methods or ():
            load_method(name)
        scales = self.scales or [scale for scale in SCALES if scale in (1, *display.scales())]
        methods = self.methods or default_methods()
        found = set[Candidate]()
        for scale in scales:
            display.low_views(scale)
            counts = self.samples if self.rays is None else [samples_at(display, scale, each) for each in self.rays]
            found |= {Candidate(scale, samples, name) for samples in counts
                      for name in methods_at(scale, methods)}
        if not found:
            raise LfsrError(f"no method of {', '.join(methods)} works at scale {', '.join(map(str, scales))}: "
                            "choose others")
        return sorted(found, key=lambda candidate: (candidate.paths(display), candidate))

    def most_paths(self, display: DisplayProfile) -> float:
        """Return the most path samples that a plan may take, unless the fewest lenses take more."""
        return max(self.budget * max(each.paths(display) for each in self.candidates(display)), FREE_PATHS)


def default_methods() -> tuple[str, ...]:
    """Simple upscaling, and where Open Image Denoise is installed the fast method and the default."""
    return PLAIN_METHOD, *((FAST_METHOD, DEFAULT_METHOD) if not oidn.why_missing() else ())


def methods_at(scale: int, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the methods ``names`` that work at ``scale``; at scale 1 without their upscalers."""
    parsed = map(MethodName.parse, names)
    return tuple(dict.fromkeys(name.at_scale(scale).text for name in parsed if name.works_at(scale)))


def path_samples(frame: Frame) -> int:
    """Path samples of a render."""
    return math.prod(frame.rays.size) * frame.samples


def render_seconds(frame: Frame) -> float:
    """Seconds of a render, without a world that was rendered apart."""
    return frame.seconds["render"] - frame.seconds.get("world", 0.0)
