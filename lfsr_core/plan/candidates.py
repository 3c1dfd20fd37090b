"""Candidates of a plan and the choice of the cheapest that reaches the target, as pure functions.

``sample`` chooses lenses to look at, ``measurements`` measures candidates on them, ``times`` predicts their times;
``docs/guide/plan.md`` explains the rules.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterable, Sequence

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.depth_scale import samples_at
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.plan.estimate import Estimate
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, FAST_METHOD, PLAIN_METHOD, MethodName, denoise, load_method

METRICS = ("ssim_lens_fg", "ssim_lens")
SCALES, SAMPLES = (1, 2, 4, 8), (4, 16, 64, 256)
BETWEEN = "between two that were measured"
AS_GOOD = 1.05  # ratio of times within which candidates count as equally cheap: the simpler method is taken
MOST_REPEATED = 0.8  # most of a gain that the next step of samples is assumed to gain again


@dataclasses.dataclass(frozen=True, order=True)
class Candidate:
    """One way to make a frame."""

    # scale, spp: of the render, spp being samples per pixel
    scale: int
    spp: int
    method: str  # of the second stage

    @property
    def name(self) -> str:
        """Short name, as in "s4-spp16 denoise+bilinear"."""
        return f"s{self.scale}-spp{self.spp} {self.method}"

    def options(self, display: DisplayProfile) -> tuple[str, ...]:
        """Options of `lfsr render` that make it."""
        rays = self.spp / display.finished_pixels(self.scale)
        return "--scale", str(self.scale), "--rays", f"{rays:.6g}", "--method", self.method

    @property
    def steps(self) -> int:
        """Number of steps of the method: fewer are simpler."""
        return MethodName.parse(self.method).steps


@dataclasses.dataclass(frozen=True)
class Rated(Candidate):
    """A candidate with its predicted time and its accuracy."""

    seconds: float  # predicted for a whole frame
    estimate: Estimate | None = None  # accuracy, None where it was not measured
    note: str = ""  # why it was not measured, or BETWEEN

    @property
    def candidate(self) -> Candidate:
        """The candidate alone."""
        return Candidate(self.scale, self.spp, self.method)

    @property
    def low(self) -> float:
        """Lower bound of the accuracy, -inf where it was not measured."""
        return -math.inf if self.estimate is None else self.estimate.low


@dataclasses.dataclass(frozen=True)
class Choice:
    """The outcome of a plan."""

    chosen: Rated | None  # the cheapest that reaches the target with 95 % confidence, None if there is none
    best: Rated | None  # the measured candidate with the highest lower bound, None if none was measured
    limit: str = ""  # why no candidate reaches the target


def low_pixels(display: DisplayProfile, scale: int) -> int:
    """Pixels of the low-resolution EIA."""
    return math.prod(display.lenses) * math.prod(display.low_views(scale))


def samples_of(candidate: Candidate, display: DisplayProfile) -> int:
    """Path samples of a whole frame: the measure of a render's cost."""
    return low_pixels(display, candidate.scale) * candidate.spp


def candidates(display: DisplayProfile, scales: Sequence[int] | None = None, spps: Sequence[int] = SAMPLES,
               methods: Sequence[str] | None = None, rays: Sequence[float] | None = None) -> list[Candidate]:
    """Every possible combination for a display, cheapest render first.

    ``scales``: None for those of SCALES that divide the views. ``methods``: None for ``default_methods``. ``rays``: per
    finished pixel, instead of ``spps``. LfsrError for a scale that does not divide the views, samples below 1,
    impossible rays, or an unknown method.
    """
    for name in methods or ():
        load_method(name)
    for spp in spps:
        if type(spp) is not int or spp < 1:
            raise LfsrError(f"samples per pixel is {spp!r}, but a candidate needs a whole number of at least 1")
    if scales is None:
        scales = [scale for scale in SCALES if scale in (1, *display.scales())]
    for scale in scales:
        display.low_views(scale)
    methods = methods or default_methods()
    found = {Candidate(scale, spp, name) for scale in scales
             for spp in (spps if rays is None else [samples_at(display, scale, each) for each in rays])
             for name in methods_at(scale, methods, display.parallax)}
    if not found:
        raise LfsrError(f"no method of {', '.join(methods)} works at scale {', '.join(map(str, scales))}: "
                        "choose others")
    return sorted(found, key=lambda candidate: (samples_of(candidate, display), candidate))


def default_methods() -> tuple[str, ...]:
    """Simple upscaling, and where Open Image Denoise is installed the fast method and the default."""
    return PLAIN_METHOD, *((FAST_METHOD, DEFAULT_METHOD) if denoise.is_available() else ())


def between(spps: Sequence[int], steps: int) -> list[tuple[int, int, int, float]]:
    """(samples, fewer, more, weight of more): ``steps`` counts between each two of ``spps``, in equal ratios.

    Accuracy grows with the logarithm of the samples, ever more slowly: the weighted mean of both neighbours is near
    it, and rather too low.
    """
    found = []
    for fewer, more in itertools.pairwise(sorted(spps)):
        counts = {round(fewer * (more / fewer) ** (step / (steps + 1))) for step in range(1, steps + 1)}
        found += [(spp, fewer, more, math.log(spp / fewer) / math.log(more / fewer))
                  for spp in sorted(counts - {fewer, more})]
    return found


def methods_at(scale: int, names: Iterable[str], parallax: tuple[bool, bool] = (True, True)) -> tuple[str, ...]:
    """Those of the methods ``names`` that work at ``scale`` and on the display; at scale 1 without their upscalers."""
    parsed = map(MethodName.parse, names)
    return tuple(dict.fromkeys(name.at_scale(scale).text for name in parsed if name.works_at(scale)))


def choose(rated: Sequence[Rated], target: float, most_seconds: float = math.inf) -> Choice:
    """Choose the cheapest candidate whose lower bound reaches ``target`` in at most ``most_seconds``.

    More samples of the same scale and method cannot be worse. So a candidate counts only if all measured ones with
    more samples reach the target too: a lucky result at few samples is not believed. Of candidates that are equally
    cheap (AS_GOOD) the simplest is taken.
    """
    measured = [row for row in rated if row.estimate is not None and row.seconds <= most_seconds]
    if not measured:
        return Choice(None, None, "no candidate could be measured: allow more seconds, scales or methods")
    best = max(measured, key=lambda row: row.low)
    passing = [row for row in measured if all(other.low >= target for other in chain(row, rated)
                                              if other.spp >= row.spp)]
    if not passing:
        return Choice(None, best, _limit(best, rated, target, most_seconds))
    least = min(row.seconds for row in passing)
    near = [row for row in passing if row.seconds <= AS_GOOD * least]
    return Choice(min(near, key=lambda row: (row.steps, row.seconds)), best)


def chain(row: Rated, rated: Iterable[Rated]) -> list[Rated]:
    """Measured candidates of the same scale and method, fewest samples first."""
    wanted = (row.scale, row.method)
    same = [other for other in rated if (other.scale, other.method) == wanted]
    return sorted((other for other in same if other.estimate is not None), key=lambda other: other.spp)


def _limit(best: Rated, rated: Sequence[Rated], target: float, most_seconds: float) -> str:
    """Why the best candidate misses the target, and what to change."""
    if any(row.low >= target and row.seconds > most_seconds for row in rated):
        return f"time: the target is reached, but not within {most_seconds:g} s"
    if best.estimate is not None and best.estimate.mean >= target:
        return ("certainty: the best candidate's mean reaches the target, its lower bound does not; "
                "look at more lenses (--lenses)")
    means = [row.estimate.mean for row in chain(best, rated) if row.estimate is not None and row.note != BETWEEN]
    if asymptote(means) >= target:
        return f"noise: accuracy still grows with the samples; try more than {best.spp}"
    if best.scale == 1:
        return "noise: more samples hardly help at full resolution; try another method"
    return (f"upscaling: at scale {best.scale} even many more samples would stay below the target; "
            "choose a smaller scale or another method")


def asymptote(means: Sequence[float]) -> float:
    """Limit of accuracies at ever more samples (equal ratios), if gains go on shrinking as they did.

    With two accuracies the next gain is assumed to be half of theirs; with one there is none.
    """
    if len(means) < 2:
        return means[-1]
    gain = max(means[-1] - means[-2], 0.0)
    before = means[-2] - means[-3] if len(means) > 2 else 2 * gain
    repeated = min(max(gain / before, 0.0), MOST_REPEATED) if before > 0 else 0.5
    return means[-1] + gain * repeated / (1 - repeated)
