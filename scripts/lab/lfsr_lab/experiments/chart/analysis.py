"""What the cells of a chart say: fronts, times to reach an accuracy, wins and losses. Pure functions."""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence

from lfsr_lab.experiments.chart.records import (
    CEILING,
    DIRECT,
    LOW,
    MAIN_METRICS,
    Analysis,
    Ceiling,
    Cell,
    Duel,
    Goal,
    Key,
    Point,
    SceneRow,
)

LOWER_IS_BETTER = frozenset({"flip"})
METRICS = (*MAIN_METRICS, "ssim_views_fg", "ssim_eia", "ssim_lens", "psnr_fg", "flip")
TARGET, STRETCH = 1 / 4, 1 / 8
TARGET_SAMPLES = (1, 4)
RIVAL: Key = (DIRECT, "oidn")


@dataclasses.dataclass(frozen=True)
class Reach:
    """Seconds to an accuracy, None where it is never reached; ``bound``: at most so many, the curve starts above it."""

    seconds: float | None
    bound: bool = False


def sign_of(metric: str) -> int:
    """What a metric is multiplied with so that more is better."""
    return -1 if metric in LOWER_IS_BETTER else 1


def points(cells: Iterable[Cell], metric: str, with_opening: bool = False) -> list[Point]:
    """Points of every cell that has ``metric``, the ceiling's left out; ``with_opening``: opening the scene counts."""
    return [Point(*cell.key, cell.render + cell.second_stage + (cell.open_seconds if with_opening else 0),
                  sign_of(metric) * value)
            for cell in cells if cell.role != CEILING and (value := cell.value(metric)) is not None]


def dominates(one: Point, other: Point) -> bool:
    """True if ``one`` is as fast and as accurate, and better in either."""
    return (one.seconds <= other.seconds and one.value >= other.value
            and (one.seconds, one.value) != (other.seconds, other.value))


def pareto_front(candidates: Sequence[Point]) -> list[Point]:
    """The points that no other dominates, from the fastest to the most accurate."""
    front = [point for point in candidates if not any(dominates(other, point) for other in candidates)]
    return sorted(front, key=lambda point: (point.seconds, point.value))


def curves(candidates: Iterable[Point]) -> dict[Key, list[Point]]:
    """Points by (role, method), by samples."""
    found: dict[Key, list[Point]] = {}
    for point in sorted(candidates, key=lambda point: point.samples):
        found.setdefault(point.curve, []).append(point)
    return found


def time_to_reach(curve: Sequence[Point], value: float) -> Reach:
    """Least time at which a method reaches ``value``, between measured sample counts by the logarithm of time.

    Points that are slower and no better than another of the same method are left out, so that the time never falls
    as ``value`` rises.
    """
    rising = pareto_front(curve)
    if not rising or value > rising[-1].value:
        return Reach(None)
    if value <= rising[0].value:
        return Reach(rising[0].seconds, bound=value < rising[0].value)
    index = next(index for index, point in enumerate(rising) if point.value >= value)
    before, after = rising[index - 1], rising[index]
    if after.value == value:
        return Reach(after.seconds)
    part = (value - before.value) / (after.value - before.value)
    return Reach(math.exp(math.log(before.seconds) * (1 - part) + math.log(after.seconds) * part))


def face_off(ours: Sequence[Point], rivals: Mapping[Key, Sequence[Point]]) -> tuple[Duel, ...]:
    """For every measured point of every rival: how long we need for its accuracy, and who wins."""
    return tuple(_duel(time_to_reach(ours, point.value), point, point.curve)
                 for curve in rivals.values() for point in curve)


def reverse(ours: Sequence[Point], rivals: Mapping[Key, Sequence[Point]]) -> tuple[Duel, ...]:
    """For every measured point of ours (its samples, seconds, value): how long every rival needs for that accuracy."""
    return tuple(_duel(time_to_reach(curve, point.value), point, rival, of_rival=True)
                 for rival, curve in rivals.items() for point in ours)


def _duel(reach: Reach, point: Point, rival: Key, of_rival: bool = False) -> Duel:
    """``reach``: how long it takes who must match ``point``, us, or ``of_rival`` the rival."""
    ratio = None if reach.seconds is None else reach.seconds / point.seconds
    faster = ratio is not None and ratio < 1
    return Duel(*rival, point.samples, point.seconds, point.value, reach.seconds, reach.bound, ratio,
                "loss" if faster == of_rival else "win")


def target(ours: Sequence[Point], rival: Sequence[Point]) -> Goal | None:
    """Worst ratio of our time to the rival's over every accuracy it reaches from 1 to 4 samples.

    Both times are piecewise log-linear in the accuracy, so the worst lies at a measured accuracy of either.
    None where the rival was not measured there.
    """
    measured = pareto_front([point for point in rival if TARGET_SAMPLES[0] <= point.samples <= TARGET_SAMPLES[1]])
    if not measured:
        return None
    low, high = measured[0].value, measured[-1].value
    accuracies = sorted({point.value for point in (*measured, *ours) if low <= point.value <= high})
    ratios = [_ratio(ours, measured, accuracy) for accuracy in accuracies]
    known = [ratio for ratio in ratios if ratio is not None]
    worst = max(known) if len(known) == len(ratios) else None
    return Goal(low, high, worst, worst is not None and worst <= TARGET, worst is not None and worst <= STRETCH)


def _ratio(ours: Sequence[Point], rival: Sequence[Point], accuracy: float) -> float | None:
    we, they = time_to_reach(ours, accuracy), time_to_reach(rival, accuracy)
    return None if we.seconds is None or they.seconds is None else we.seconds / they.seconds


def ceiling(cells: Iterable[Cell], metric: str) -> Ceiling | None:
    """The best that a method makes of the nearly noise-free low-resolution render."""
    known = [Ceiling(cell.method, cell.samples, value) for cell in cells
             if cell.role == CEILING and (value := cell.value(metric)) is not None]
    return max(known, key=lambda found: sign_of(metric) * found.value, default=None)


def analyse(cells: Sequence[Cell], ours: str, metric: str = MAIN_METRICS[0]) -> Analysis:
    """Everything about one scene and one metric."""
    found, opened = curves(points(cells, metric)), curves(points(cells, metric, with_opening=True))
    us: Key = (LOW, ours)
    rival = found.get(RIVAL, [])
    mine = found.get(us, [])
    others = {key: curve for key, curve in found.items() if key != us}
    front = pareto_front([point for curve in found.values() for point in curve])
    return Analysis(metric, ceiling(cells, metric), tuple(front), target(mine, rival),
                    target(opened.get(us, []), opened.get(RIVAL, [])),
                    {method: target(curve, rival) for (role, method), curve in others.items() if role == LOW},
                    face_off(mine, others), reverse(mine, others))


def mean_points(scenes: Sequence[SceneRow], metric: str) -> list[Point]:
    """Points that every scene has: geometric mean of the seconds, mean of the metric."""
    tables = [{(*point.curve, point.samples): point for point in points(scene.cells, metric)} for scene in scenes]
    shared = [key for key in (tables[0] if tables else {}) if all(key in table for table in tables)]
    return [Point(*key, statistics.geometric_mean(table[key].seconds for table in tables),
                  statistics.fmean(table[key].value for table in tables)) for key in shared]
