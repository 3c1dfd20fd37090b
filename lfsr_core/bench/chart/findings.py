"""What a chart says, in sentences made from its numbers: when to use what, the target, wins and losses."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from itertools import groupby
from typing import Any

from lfsr_core.bench.chart.analysis import (
    DIRECT,
    LOW,
    MAIN_METRIC,
    RIVAL,
    STRETCH,
    TARGET,
    Point,
    mean_points,
    pareto_front,
)
from lfsr_core.bench.chart.panels import label
from lfsr_core.bench.plots import time_text

LITTLE_MORE, LEAST_GAIN = 1.15, 0.005  # steps of advice smaller than these are not worth a line


def advice(chart: dict[str, Any]) -> list[tuple[str, str, str]]:
    """(from how many seconds on, which method and samples, what it reaches): the front of the mean, in steps."""
    front = worth_a_step(pareto_front(mean_points(chart["scenes"], MAIN_METRIC)))
    steps = []
    for key, group in groupby(front, key=lambda point: (point.role, point.method)):
        run = list(group)
        values = f"{run[0].value:.3f}" if len(run) == 1 else f"{run[0].value:.3f} to {run[-1].value:.3f}"
        counts = ", ".join(str(point.samples) for point in run)
        noun = "sample" if counts == "1" else "samples"
        steps.append((time_text(run[0].seconds), f"{label(key, chart['settings']['ours'])} at {counts} {noun}", values))
    return steps


def worth_a_step(front: Sequence[Point]) -> list[Point]:
    """The points of a front that are worth waiting for: without those that a little more time betters, then without
    those that better the one before by less than LEAST_GAIN."""
    patient = [point for point in front
               if not any(other.value > point.value and other.seconds <= LITTLE_MORE * point.seconds
                          for other in front)]
    kept: list[Point] = []
    for point in patient:
        if not kept or point.value >= kept[-1].value + LEAST_GAIN:
            kept.append(point)
    return kept


def goals(chart: dict[str, Any]) -> list[tuple[str, float | None, bool, float | None]]:
    """(scene, worst ratio of our time to direct rendering's, whether it is known, the same with opening the scene)."""
    rows = []
    for scene in chart["scenes"]:
        plain, opened = (scene["analysis"][0][name] for name in ("target", "target_with_opening"))
        rows.append((scene["scene"], plain and plain["worst_ratio"], plain is not None,
                     opened and opened["worst_ratio"]))
    return rows


def best_of_others(chart: dict[str, Any]) -> dict[str, str]:
    """By scene, which method other than our default comes nearest to the target, and its ratio."""
    found = {}
    for scene in chart["scenes"]:
        ratios = {method: goal["worst_ratio"] for method, goal in scene["analysis"][0]["targets_of_others"].items()
                  if goal and goal["worst_ratio"] is not None}
        best = min(ratios, key=lambda method: ratios[method], default=None)
        found[scene["scene"]] = "none" if best is None else f"{best}: {ratios[best]:.2f}"
    return found


def headline(chart: dict[str, Any]) -> str:
    """The target in one sentence: how much of direct rendering's time we need, on how many scenes it is met."""
    known = [row for row in goals(chart) if row[2]]
    if not known:
        return "Direct high-resolution rendering with OIDN was not measured at 1 to 4 samples."
    ratios = [ratio for _, ratio, _, _ in known if ratio is not None]
    met, stretch = (sum(ratio <= goal for ratio in ratios) for goal in (TARGET, STRETCH))
    lost = len(known) - len(ratios)
    words = f"{chart['settings']['ours']} reaches every accuracy of rendering all views at 1 to 4 samples with OIDN "
    words += f"in {_range(ratios)} of the time" if ratios else "on no scene"
    words += f" on {len(ratios)} of {len(known)} scenes, and not all of them on the others" if lost and ratios else ""
    return words + f". A quarter or less: {met} of {len(known)} scenes; an eighth or less: {stretch} of {len(known)}."


def _range(ratios: Sequence[float]) -> str:
    low, high = _share(min(ratios)), _share(max(ratios))
    return low if low == high else f"{low} to {high}"


def _share(ratio: float) -> str:
    return f"{ratio:.0%}" if ratio >= 0.1 else f"{ratio:.1%}"


def losses(chart: dict[str, Any]) -> list[str]:
    """A sentence for every method that our default loses to somewhere, most often first; one if there is none."""
    lost: dict[tuple[str, str], list[tuple[str, int]]] = {}
    played: dict[tuple[str, str], int] = {}
    for scene in chart["scenes"]:
        for duel in scene["analysis"][0]["versus"]:
            key = (duel["role"], duel["method"])
            played[key] = played.get(key, 0) + 1
            if duel["outcome"] == "loss":
                lost.setdefault(key, []).append((scene["scene"], duel["samples"]))
    ours = chart["settings"]["ours"]
    order = sorted(lost, key=lambda key: (key[0] != DIRECT, -len(lost[key])))
    return [f"{label(key, ours)}: wins {len(lost[key])} of {played[key]} times ({_places(lost[key])})"
            for key in order] or [f"{ours} loses to no method that was measured, at no accuracy, on no scene."]


def _places(found: Sequence[tuple[str, int]]) -> str:
    by_scene: dict[str, list[int]] = {}
    for scene, samples in found:
        by_scene.setdefault(scene, []).append(samples)
    return "; ".join(f"{scene} at {', '.join(map(str, sorted(samples)))}" for scene, samples in by_scene.items())


def opening(chart: dict[str, Any]) -> str:
    """How long opening a scene takes, which the time axis leaves out."""
    seconds = [statistics.median(cell["open_seconds"] for cell in scene["cells"]) for scene in chart["scenes"]]
    return f"{min(seconds):.1f} to {max(seconds):.1f} s" if len(seconds) > 1 else f"{seconds[0]:.1f} s"


def duels_with_direct(scene: dict[str, Any]) -> list[dict[str, Any]]:
    """Our default against direct rendering, denoised first."""
    found = [duel for duel in scene["analysis"][0]["versus"] if duel["role"] == DIRECT]
    return sorted(found, key=lambda duel: ((duel["role"], duel["method"]) != RIVAL, duel["samples"]))


def duels_with_low(scene: dict[str, Any]) -> list[dict[str, Any]]:
    """Our default against the other methods on the same renders."""
    return [duel for duel in scene["analysis"][0]["versus"] if duel["role"] == LOW]
