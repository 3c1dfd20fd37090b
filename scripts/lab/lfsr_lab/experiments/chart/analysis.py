"""What follows from the cells of a chart: fronts, times to reach an accuracy, wins and losses. Pure functions."""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Iterable, Sequence

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
    Spread,
)

METRICS = (*MAIN_METRICS, "ssim_views_fg", "ssim_eia", "ssim_lens", "psnr_fg", "flip")
TARGET, STRETCH = 1 / 4, 1 / 8
TARGET_SAMPLES = (1, 4)
RIVAL: Key = (DIRECT, "oidn")


def sign_of(metric: str) -> int:
    """Return the factor that makes more of a metric better."""
    return -1 if metric == "flip" else 1


def points(cells: Iterable[Cell], metric: str, with_opening: bool = False) -> list[Point]:
    """Return the point of every cell that has ``metric``, but for the ceiling's.

    ``with_opening``: the time of opening the scene counts.
    """
    return [Point(*cell.key, cell.seconds.median + (cell.open_seconds if with_opening else 0), sign_of(metric) * value)
            for cell in cells if cell.role != CEILING and (value := cell.metrics.get(metric)) is not None]


def pareto_front(candidates: Iterable[Point]) -> list[Point]:
    """Return the points that are better than every faster one, from the fastest to the most accurate."""
    front: list[Point] = []
    for point in sorted(candidates, key=lambda point: (point.seconds, -point.value)):
        if not front or point.value > front[-1].value:
            front.append(point)
    return front


def curves(candidates: Iterable[Point]) -> dict[Key, list[Point]]:
    """Return points by role and method, each curve by samples."""
    found: dict[Key, list[Point]] = {}
    for point in sorted(candidates, key=lambda point: point.samples):
        found.setdefault(point.curve, []).append(point)
    return found


def time_to_reach(curve: Iterable[Point], value: float) -> tuple[float | None, bool]:
    """Return the least seconds at which a method reaches ``value``, None for never, and whether it may need less.

    Between two sample counts time is interpolated by its logarithm. Points that are slower and no better than another
    one are left out, so that the time never falls as ``value`` rises.
    """
    rising = pareto_front(curve)
    if not rising or value > rising[-1].value:
        return None, False
    if value <= rising[0].value:
        return rising[0].seconds, value < rising[0].value
    index = next(index for index, point in enumerate(rising) if point.value >= value)
    before, after = rising[index - 1], rising[index]
    if after.value == value:
        return after.seconds, False
    part = (value - before.value) / (after.value - before.value)
    return math.exp(math.log(before.seconds) * (1 - part) + math.log(after.seconds) * part), False


def duel(point: Point, curve: Iterable[Point], rival: Key, of_rival: bool = False) -> Duel:
    """Return how ``curve``, ours or ``of_rival`` the rival's, does against ``point``: how long it takes, who wins."""
    seconds, bound = time_to_reach(curve, point.value)
    ratio = None if seconds is None else seconds / point.seconds
    faster = ratio is not None and ratio < 1
    return Duel(*rival, point.samples, point.seconds, point.value, seconds, bound, ratio,
                "loss" if faster == of_rival else "win")


def target(ours: Sequence[Point], rival: Sequence[Point]) -> Goal | None:
    """Return the worst ratio of our time to the rival's over every accuracy it reaches from 1 to 4 samples.

    Both times are piecewise log-linear in the accuracy, so the worst lies at a measured accuracy of either.
    None where the rival was not measured there.
    """
    measured = pareto_front(point for point in rival if TARGET_SAMPLES[0] <= point.samples <= TARGET_SAMPLES[1])
    if not measured:
        return None
    low, high = measured[0].value, measured[-1].value
    accuracies = {point.value for point in (*measured, *ours) if low <= point.value <= high}
    times = [(time_to_reach(ours, accuracy)[0], time_to_reach(measured, accuracy)[0]) for accuracy in accuracies]
    ratios = [we / they for we, they in times if we is not None and they is not None]
    worst = max(ratios) if len(ratios) == len(times) else None
    return Goal(low, high, worst, worst is not None and worst <= TARGET, worst is not None and worst <= STRETCH)


def ceiling(cells: Iterable[Cell], metric: str) -> Ceiling | None:
    """Return the best that a method makes of the nearly noise-free low-resolution render."""
    known = [Ceiling(cell.method, cell.samples, value) for cell in cells
             if cell.role == CEILING and (value := cell.metrics.get(metric)) is not None]
    return max(known, key=lambda found: sign_of(metric) * found.value, default=None)


def analyse(cells: Sequence[Cell], ours: str, metric: str = MAIN_METRICS[0]) -> Analysis:
    """Return everything that follows from one scene by one metric."""
    found, opened = curves(points(cells, metric)), curves(points(cells, metric, with_opening=True))
    us: Key = (LOW, ours)
    mine, rival = found.get(us, []), found.get(RIVAL, [])
    others = {key: curve for key, curve in found.items() if key != us}
    front = pareto_front(point for curve in found.values() for point in curve)
    return Analysis(metric, ceiling(cells, metric), tuple(front), target(mine, rival),
                    target(opened.get(us, []), opened.get(RIVAL, [])),
                    {method: target(curve, rival) for (role, method), curve in others.items() if role == LOW},
                    tuple(duel(point, mine, key) for key, curve in others.items() for point in curve),
                    tuple(duel(point, curve, key, of_rival=True) for key, curve in others.items() for point in mine))


def mean_cells(scenes: Sequence[SceneRow]) -> list[Cell]:
    """Return the cells that every scene has: geometric means of times, means of metrics, no intervals."""
    tables = [{cell.key: cell for cell in scene.cells} for scene in scenes]
    return [_mean([table[key] for table in tables]) for key in tables[0] if all(key in table for table in tables)]


def _mean(cells: Sequence[Cell]) -> Cell:
    first = cells[0]
    seconds = [_typical(values) for values in zip(*(dataclasses.astuple(cell.seconds) for cell in cells), strict=True)]
    return dataclasses.replace(
        first, seconds=Spread(*seconds), ci95={}, second_stage_seconds=(_typical(cell.second_stage for cell in cells),),
        stage_seconds={name: _typical(cell.stage_seconds[name] for cell in cells) for name in first.stage_seconds},
        metrics={name: average([cell.metrics.get(name) for cell in cells]) for name in first.metrics})


def _typical(values: Iterable[float]) -> float:
    """Return the geometric mean, 0 where any value is 0."""
    known = list(values)
    return statistics.geometric_mean(known) if min(known) > 0 else 0.0


def average(values: Sequence[float | None]) -> float | None:
    """Return the mean, None where a value is missing."""
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if len(known) == len(values) else None
