"""What the cells of a chart say: fronts, times to reach an accuracy, wins and losses. Pure functions."""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Iterable, Sequence
from typing import Any

LOWER_IS_BETTER = frozenset({"flip"})
MAIN_METRIC = "ssim_eia_fg"
METRICS = (MAIN_METRIC, "ssim_views_fg", "ssim_eia", "psnr_fg", "flip")
LOW, DIRECT, CEILING = "low", "direct", "ceiling"
TARGET, STRETCH = 1 / 4, 1 / 8
TARGET_SAMPLES = (1, 4)
RIVAL = (DIRECT, "oidn")


@dataclasses.dataclass(frozen=True)
class Point:
    """One measured cell: ``value`` is higher where better, ``seconds`` > 0 are end to end."""

    role: str
    method: str
    samples: int
    seconds: float
    value: float


@dataclasses.dataclass(frozen=True)
class Reach:
    """Seconds to an accuracy, None where it is never reached; ``bound``: at most so many, the curve starts above it."""

    seconds: float | None
    bound: bool = False


def end_to_end(cell: dict[str, Any], with_opening: bool = False) -> float:
    """Median Cycles seconds and median seconds of the second stage of a cell, added."""
    seconds = statistics.median(cell["render_seconds"]) + statistics.median(cell["second_stage_seconds"])
    return seconds + cell["open_seconds"] if with_opening else seconds


def points(cells: Iterable[dict[str, Any]], metric: str, with_opening: bool = False) -> list[Point]:
    """Points of every cell that has ``metric``, the ceiling's left out."""
    sign = -1 if metric in LOWER_IS_BETTER else 1
    return [Point(cell["role"], cell["method"], cell["samples"], end_to_end(cell, with_opening),
                  sign * cell["metrics"][metric])
            for cell in cells if cell["role"] != CEILING and cell["metrics"][metric] is not None]


def dominates(one: Point, other: Point) -> bool:
    """True if ``one`` is as fast and as accurate, and better in either."""
    return (one.seconds <= other.seconds and one.value >= other.value
            and (one.seconds, one.value) != (other.seconds, other.value))


def pareto_front(candidates: Sequence[Point]) -> list[Point]:
    """The points that no other dominates, from the fastest to the most accurate."""
    front = [point for point in candidates if not any(dominates(other, point) for other in candidates)]
    return sorted(front, key=lambda point: (point.seconds, point.value))


def curves(candidates: Iterable[Point]) -> dict[tuple[str, str], list[Point]]:
    """Points by (role, method), by samples."""
    found: dict[tuple[str, str], list[Point]] = {}
    for point in sorted(candidates, key=lambda point: point.samples):
        found.setdefault((point.role, point.method), []).append(point)
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


def face_off(ours: Sequence[Point], rivals: dict[tuple[str, str], list[Point]]) -> list[dict[str, Any]]:
    """For every measured point of every rival: how long we need for its accuracy, and who wins.

    "ratio" is our time over its time; an upper bound where "bound", None where we never get there.
    """
    return [_duel(time_to_reach(ours, point.value), point)
            for curve in rivals.values() for point in curve]


def reverse(ours: Sequence[Point], rivals: dict[tuple[str, str], list[Point]]) -> list[dict[str, Any]]:
    """For every measured point of ours (its samples, seconds, value): how long every rival needs for that accuracy."""
    return [_duel(time_to_reach(curve, point.value), point, of_rival=True) | {"role": role, "method": method}
            for (role, method), curve in rivals.items() for point in ours]


def _duel(reach: Reach, point: Point, of_rival: bool = False) -> dict[str, Any]:
    """``reach``: who must match ``point``, we, or ``of_rival`` the rival."""
    ratio = None if reach.seconds is None else reach.seconds / point.seconds
    faster = ratio is not None and ratio < 1
    return {"role": point.role, "method": point.method, "samples": point.samples, "seconds": point.seconds,
            "value": point.value, "needs_seconds": reach.seconds, "bound": reach.bound, "ratio": ratio,
            "outcome": "loss" if faster == of_rival else "win"}


def target(ours: Sequence[Point], rival: Sequence[Point]) -> dict[str, Any] | None:
    """Worst ratio of our time to the rival's over every accuracy it reaches from 1 to 4 samples.

    Both times are piecewise log-linear in the accuracy, so the worst lies at a measured accuracy of either.
    None where the rival was not measured there; "worst_ratio" None where we fail to reach one of them.
    """
    measured = pareto_front([point for point in rival if TARGET_SAMPLES[0] <= point.samples <= TARGET_SAMPLES[1]])
    if not measured:
        return None
    low, high = measured[0].value, measured[-1].value
    accuracies = sorted({point.value for point in (*measured, *ours) if low <= point.value <= high})
    ratios = [_ratio(ours, measured, accuracy) for accuracy in accuracies]
    worst = None if None in ratios else max(ratios)
    return {"from_value": low, "to_value": high, "worst_ratio": worst, "met": worst is not None and worst <= TARGET,
            "stretch_met": worst is not None and worst <= STRETCH}


def _ratio(ours: Sequence[Point], rival: Sequence[Point], accuracy: float) -> float | None:
    we, they = time_to_reach(ours, accuracy), time_to_reach(rival, accuracy)
    return None if we.seconds is None else we.seconds / they.seconds


def ceiling(cells: Iterable[dict[str, Any]], metric: str) -> dict[str, Any] | None:
    """The best that a method makes of the nearly noise-free low-resolution render: {"method", "value"}."""
    sign = -1 if metric in LOWER_IS_BETTER else 1
    known = [cell for cell in cells if cell["role"] == CEILING and cell["metrics"][metric] is not None]
    best = max(known, key=lambda cell: sign * cell["metrics"][metric], default=None)
    return best and {"method": best["method"], "samples": best["samples"], "value": best["metrics"][metric]}


def analyse(cells: Sequence[dict[str, Any]], ours: str, metric: str = MAIN_METRIC) -> dict[str, Any]:
    """Everything about one scene and one metric, JSON-ready. Values of metrics where less is better have their sign
    turned, so that more is better everywhere."""
    found = curves(points(cells, metric))
    mine = found.get((LOW, ours), [])
    rivals = {key: curve for key, curve in found.items() if key != (LOW, ours)}
    opened = curves(points(cells, metric, with_opening=True))
    every = [point for curve in found.values() for point in curve]
    return {"metric": metric, "ceiling": ceiling(cells, metric),
            "front": [dataclasses.asdict(point) for point in pareto_front(every)],
            "target": target(mine, found.get(RIVAL, [])),
            "target_with_opening": target(opened.get((LOW, ours), []), opened.get(RIVAL, [])),
            "targets_of_others": {method: target(curve, found.get(RIVAL, []))
                                  for (role, method), curve in found.items() if role == LOW and method != ours},
            "versus": face_off(mine, rivals), "reverse": reverse(mine, rivals)}


def mean_points(scenes: Sequence[dict[str, Any]], metric: str) -> list[Point]:
    """Points that every scene has: geometric mean of the seconds, mean of the metric."""
    tables = [{(point.role, point.method, point.samples): point for point in points(scene["cells"], metric)}
              for scene in scenes]
    shared = [key for key in (tables[0] if tables else {}) if all(key in table for table in tables)]
    return [Point(*key, statistics.geometric_mean(table[key].seconds for table in tables),
                  statistics.fmean(table[key].value for table in tables)) for key in shared]
