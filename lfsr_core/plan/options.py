"""What a plan is asked: target, candidates, cost of the sample; and what it answers: the cheapest that reaches it."""

import dataclasses
import math
from collections.abc import Iterable, Sequence

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.base.records import is_whole
from lfsr_core.frames.frame import Frame, samples_at
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, FAST_METHOD, PLAIN_METHOD, MethodName, load_method
from lfsr_core.reconstruct.methods.denoise import why_missing

METRICS = ("ssim_lens_fg", "ssim_lens")
SCALES, SAMPLES = (1, 2, 4, 8), (4, 16, 64, 256)
FREE_PATHS = 10**7  # path samples, a few seconds of most scenes, that a plan may take beyond its budget
AS_GOOD = 1.05  # ratio of times within which candidates count as equally cheap: the simpler method is taken


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
    budget: float = 0.02
    lenses: int | None = None  # number of lenses to sample, whatever the budget; None for the usual number
    reference_samples: int = 128  # samples per pixel of the sampled lenses' reference

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
        if self.most_seconds is not None and not 0 < self.most_seconds < math.inf:
            raise LfsrError(f"seconds are {self.most_seconds}, but they must be above 0 and finite")
        for samples in self.samples:
            if not is_whole(samples) or samples < 1:
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
        methods, candidates = self.methods or default_methods(), set[Candidate]()
        for scale in scales:
            display.low_views(scale)
            counts = self.samples if self.rays is None else [samples_at(display, scale, rays) for rays in self.rays]
            candidates |= {Candidate(scale, samples, name) for samples in counts for name in methods_at(scale, methods)}
        if not candidates:
            raise LfsrError(f"no method of {', '.join(methods)} works at scale {', '.join(map(str, scales))}: "
                            "choose others")
        return sorted(candidates, key=lambda candidate: (candidate.paths(display), candidate))

    def most_paths(self, display: DisplayProfile) -> float:
        """Return the most path samples that a plan may take, unless the fewest lenses take more."""
        return max(self.budget * max(candidate.paths(display) for candidate in self.candidates(display)), FREE_PATHS)


def default_methods() -> tuple[str, ...]:
    """Simple upscaling, and where Open Image Denoise is installed the fast method and the default."""
    return PLAIN_METHOD, *((FAST_METHOD, DEFAULT_METHOD) if not why_missing() else ())


def methods_at(scale: int, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the methods ``names`` that work at ``scale``; at scale 1 without their upscalers."""
    parsed = map(MethodName.parse, names)
    return tuple(dict.fromkeys(name.at_scale(scale).text for name in parsed if name.works_at(scale)))


@dataclasses.dataclass(frozen=True)
class Measured:
    """How fast a scene renders, measured on a few of its lenses."""

    fixed: float  # seconds before the first sample
    per_path: float  # seconds of a path sample
    scale: int  # of that render, chosen by Auto


def path_samples(frame: Frame) -> int:
    """Path samples of a render."""
    return math.prod(frame.rays.size) * frame.samples


def render_seconds(frame: Frame) -> float:
    """Seconds of a render, without a world that was rendered apart."""
    return frame.seconds["render"] - frame.seconds.get("world", 0.0)


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

    def is_as_cheap(self, seconds: float) -> bool:
        """Return True if it is about as cheap as what takes ``seconds``, or cheaper."""
        return self.seconds <= AS_GOOD * seconds


@dataclasses.dataclass(frozen=True)
class Choice:
    """The outcome of a plan."""

    chosen: Rated | None  # the cheapest that reaches the target with confidence, None if there is none
    best: Rated | None  # the measured candidate with the highest lower bound, None if none was measured
    limit: Notice | None = None  # what keeps every candidate from the target


def estimate(values: Array, counts: Array, population: int) -> Estimate:
    """Estimate the accuracy of a frame from the ``values`` (n,) of lenses drawn at random from ``population``.

    ``counts`` (n,) bool: those that count for the metric; their fraction of the population is that of the sample.
    LfsrError where fewer than two count, because then their spread is unknown.
    """
    from lfsr_core.metrics.eia_metrics import stratum  # needs OpenImageIO, which Blender's panel does without

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
    if passing := [row for row in measured if row.low >= target]:
        least = min(row.seconds for row in passing)
        near = [row for row in passing if row.is_as_cheap(least)]
        return Choice(min(near, key=lambda row: (MethodName.parse(row.method).steps, row.seconds)), best)
    # What keeps the best candidate from the target.
    if any(row.low >= target and row.seconds > most_seconds for row in rated):
        return Choice(None, best, Notice("plan-limit-time", {"seconds": most_seconds}))
    if best is None or best.estimate is None:
        return Choice(None, best, Notice("plan-limit-unmeasured"))
    if best.estimate.mean >= target:
        return Choice(None, best, Notice("plan-limit-certainty", {"lenses": best.estimate.lenses}))
    means = {row.samples: row.estimate.mean for row in rated
             if row.estimate is not None and (row.scale, row.method) == (best.scale, best.method)}
    *_, before, last = (-math.inf, *(means[samples] for samples in sorted(means)))
    if last + (last - before) >= target:  # a further step gains about half of the one before; a first one may, any
        is_slow = any(row.unmeasured is not None and row.unmeasured.code == "candidate-too-slow" for row in rated)
        return Choice(None, best, Notice("plan-limit-time", {"seconds": most_seconds}) if is_slow
                      else Notice("plan-limit-noise", {"samples": best.samples}))
    return Choice(None, best, Notice("plan-limit-upscaling" if best.scale > 1 else "plan-limit-method",
                                     {"scale": best.scale}))
