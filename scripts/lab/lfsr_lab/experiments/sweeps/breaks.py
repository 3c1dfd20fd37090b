"""Where a method breaks along a sweep, and how sure that is over seeds of the render's noise: the one rule."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import fmean

import numpy as np

from lfsr_lab.experiments.engine.seeds import Estimate, estimate

DROP = 0.05       # how far below its own start a method counts as broken
TOLERANCE = 1e-9  # rounding of the difference of two measured figures
BELOW_BICUBIC, BELOW_START = "below bicubic", "below its start"
Figures = Mapping[float, Sequence[float | None]]
"""Judged figures by value of a sweep, one per seed; None where one could not be measured."""


@dataclasses.dataclass(frozen=True)
class Break:
    """Where a method breaks."""

    value: float  # of the sweep
    quality: float  # the judged figure there, mean over seeds
    reason: str  # BELOW_BICUBIC or BELOW_START
    # Where it breaks with 95 % confidence over the seeds: the first value at which it may be broken, and the first at
    # which it surely is. None with one seed, ``latest`` also where it is sure at no value.
    earliest: float | None = None
    latest: float | None = None


@dataclasses.dataclass(frozen=True)
class Margin:
    """How far a method is above one of its limits at one value; it breaks at 0."""

    value: float  # of the sweep
    quality: float  # the judged figure, mean over seeds
    limit: str  # BELOW_BICUBIC or BELOW_START
    above: Estimate  # over seeds


def breaking_point(values: Sequence[float], quality: Figures, bicubic: Figures | None = None) -> Break | None:
    """Return where a method breaks: its first value below ``bicubic``, or DROP below its own start.

    Parameters
    ----------
    values : of the sweep, from easy to hard; the start is the first of them with a quality
    quality : the method's; values without one are passed over
    bicubic : bicubic's with the same seeds, None where it is not compared

    Returns
    -------
    None where the method never breaks on the mean over seeds
    """
    found = list(_margins(values, quality, bicubic or {}))
    broken = next((margin for margin in found if margin.above.mean <= 0), None)
    if broken is None:
        return None
    sure = [margin for margin in found if margin.above.spread is not None]
    earliest = next((margin.value for margin in sure if margin.above.low <= 0), None)
    latest = next((margin.value for margin in sure if margin.above.high <= 0), None)
    return Break(broken.value, broken.quality, broken.limit, earliest, latest)


def near_breaks(values: Sequence[float], breaks: Iterable[Break | None]) -> set[float]:
    """Return the values that decide where methods break: those of ``breaks``, their neighbours, and the start."""
    places = [values.index(found.value) for found in breaks if found]
    return {values[near] for place in places for near in (0, place - 1, place, place + 1) if 0 <= near < len(values)}


def _margins(values: Sequence[float], quality: Figures, bicubic: Figures) -> Iterator[Margin]:
    """Yield the margins at every value where the method was measured, paired by seed."""
    start: Sequence[float | None] = ()
    for value in values:
        own = quality.get(value, ())
        known = [figure for figure in own if figure is not None]
        start = start or known
        limits = ((BELOW_BICUBIC, bicubic.get(value, ()), TOLERANCE), (BELOW_START, start, DROP - TOLERANCE))
        for limit, others, allowed in limits:
            above = [figure - other + allowed for figure, other in zip(own, others, strict=False)
                     if figure is not None and other is not None]
            if above:
                yield Margin(value, fmean(known), limit, estimate(np.array(above)[:, None]))
