"""What a chart says, in sentences made from its numbers."""

from __future__ import annotations

import collections
import statistics
from collections.abc import Mapping, Sequence
from itertools import groupby

from lfsr_lab.experiments.chart.analysis import RIVAL, mean_cells, pareto_front, points
from lfsr_lab.experiments.chart.records import DIRECT, Chart, Key, Point
from lfsr_lab.experiments.engine.plots import time_text

LITTLE_MORE, LEAST_GAIN = 1.15, 0.005  # steps of advice smaller than these are not worth a line


def label(key: Key, ours: str) -> str:
    """Return a method as the page calls it."""
    role, name = key
    if role == DIRECT:
        return "every view" if name == "none" else f"every view +{name.upper() if name == RIVAL[1] else name}"
    return f"{name} (ours)" if name == ours else name


def advice(chart: Chart) -> list[list[str]]:
    """Return the front of the mean in steps: from how many seconds on, which method and samples, what it reaches."""
    steps = []
    for key, group in groupby(worth_a_step(pareto_front(points(mean_cells(chart.scenes), chart.metric))),
                              key=lambda point: point.curve):
        run = list(group)
        values = f"{run[0].value:.3f}" if len(run) == 1 else f"{run[0].value:.3f} to {run[-1].value:.3f}"
        counts = ", ".join(str(point.samples) for point in run)
        noun = "sample" if counts == "1" else "samples"
        steps.append([f"from {time_text(run[0].seconds)}",
                      f"{label(key, chart.settings.ours)} at {counts} {noun}", values])
    return steps


def worth_a_step(front: Sequence[Point]) -> list[Point]:
    """Return the points of a front that a little more time does not better, and that better the one before."""
    patient = [point for point in front
               if not any(other.value > point.value and other.seconds <= LITTLE_MORE * point.seconds
                          for other in front)]
    worth: list[Point] = []
    for point in patient:
        if not worth or point.value >= worth[-1].value + LEAST_GAIN:
            worth.append(point)
    return worth


def headline(chart: Chart) -> str:
    """Return in one sentence how much of direct rendering's time we need, and on how many scenes the target is met."""
    known = [goal for scene in chart.scenes if (goal := scene.by(chart.metric).target)]
    if not known:
        return "Direct high-resolution rendering with OIDN was not measured at 1 to 4 samples."
    ratios = [goal.worst_ratio for goal in known if goal.worst_ratio is not None]
    words = f"{chart.settings.ours} reaches every accuracy of rendering all views at 1 to 4 samples with OIDN "
    words += f"in {_range(ratios)} of the time" if ratios else "on no scene"
    if 0 < len(ratios) < len(known):
        words += f" on {len(ratios)} of {len(known)} scenes, and not all of them on the others"
    return (f"{words}. A quarter or less: {sum(goal.met for goal in known)} of {len(known)} scenes; "
            f"an eighth or less: {sum(goal.stretch_met for goal in known)} of {len(known)}.")


def _range(ratios: Sequence[float]) -> str:
    low, high = (f"{ratio:.0%}" if ratio >= 0.1 else f"{ratio:.1%}" for ratio in (min(ratios), max(ratios)))
    return low if low == high else f"{low} to {high}"


def losses(chart: Chart) -> list[str]:
    """Return a sentence for every method that ours loses to, most often first, or one that there is none."""
    ours, duels = chart.settings.ours, collections.Counter[Key]()
    lost: dict[Key, dict[str, list[int]]] = {}
    for scene in chart.scenes:
        for duel in scene.by(chart.metric).versus:
            duels[duel.curve] += 1
            if duel.outcome == "loss":
                lost.setdefault(duel.curve, {}).setdefault(scene.scene, []).append(duel.samples)
    times = {key: sum(map(len, places.values())) for key, places in lost.items()}
    return [f"{label(key, ours)}: wins {times[key]} of {duels[key]} times ({_places(lost[key])})"
            for key in sorted(lost, key=lambda key: (key[0] != DIRECT, -times[key]))] or [
                f"{ours} loses to no method that was measured, at no accuracy, on no scene."]


def _places(samples_of: Mapping[str, Sequence[int]]) -> str:
    return "; ".join(f"{scene} at {', '.join(map(str, sorted(samples)))}" for scene, samples in samples_of.items())


def opening(chart: Chart) -> str:
    """Return how long opening a scene takes, which the time axis leaves out."""
    seconds = [statistics.median(cell.open_seconds for cell in scene.cells) for scene in chart.scenes]
    return f"{min(seconds):.1f} to {max(seconds):.1f} s" if len(seconds) > 1 else f"{seconds[0]:.1f} s"
