"""What a chart says, in sentences made from its numbers: when to use what, the target, wins and losses."""

from __future__ import annotations

import collections
import dataclasses
import statistics
from collections.abc import Mapping, Sequence
from itertools import groupby

from lfsr_lab.experiments.chart.analysis import RIVAL, STRETCH, TARGET, mean_points, pareto_front
from lfsr_lab.experiments.chart.panels import label
from lfsr_lab.experiments.chart.records import DIRECT, Analysis, Chart, Duel, Key, Point, SceneRow
from lfsr_lab.experiments.engine.plots import time_text

LITTLE_MORE, LEAST_GAIN = 1.15, 0.005  # steps of advice smaller than these are not worth a line


@dataclasses.dataclass(frozen=True)
class GoalRow:
    """How our method does against the target on one scene."""

    scene: str  # its name
    known: bool  # whether direct rendering was measured at the target's samples
    ratio: float | None  # worst ratio of our time to its, None where we never get there
    opened: float | None  # the same with opening the scene
    best: str  # which other method comes nearest to the target, and its ratio


def advice(chart: Chart) -> list[tuple[str, str, str]]:
    """(from how many seconds on, which method and samples, what it reaches): the front of the mean, in steps."""
    front = worth_a_step(pareto_front(mean_points(chart.scenes, chart.metric)))
    steps = []
    for key, group in groupby(front, key=lambda point: point.curve):
        run = list(group)
        values = f"{run[0].value:.3f}" if len(run) == 1 else f"{run[0].value:.3f} to {run[-1].value:.3f}"
        counts = ", ".join(str(point.samples) for point in run)
        noun = "sample" if counts == "1" else "samples"
        steps.append((time_text(run[0].seconds), f"{label(key, chart.settings.ours)} at {counts} {noun}", values))
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


def goals(chart: Chart) -> list[GoalRow]:
    """The target, scene by scene."""
    return [_goal(scene, scene.by(chart.metric)) for scene in chart.scenes]


def _goal(scene: SceneRow, main: Analysis) -> GoalRow:
    plain, opened, others = main.target, main.target_with_opening, main.targets_of_others
    ratios = {method: goal.worst_ratio for method, goal in others.items() if goal and goal.worst_ratio is not None}
    best = min(ratios, key=lambda method: ratios[method], default=None)
    return GoalRow(scene.scene, plain is not None, plain.worst_ratio if plain else None,
                   opened.worst_ratio if opened else None,
                   "none" if best is None else f"{best}: {ratios[best]:.2f}")


def headline(chart: Chart) -> str:
    """The target in one sentence: how much of direct rendering's time we need, on how many scenes it is met."""
    known = [row for row in goals(chart) if row.known]
    if not known:
        return "Direct high-resolution rendering with OIDN was not measured at 1 to 4 samples."
    ratios = [row.ratio for row in known if row.ratio is not None]
    met, stretch = (sum(ratio <= goal for ratio in ratios) for goal in (TARGET, STRETCH))
    lost = len(known) - len(ratios)
    words = f"{chart.settings.ours} reaches every accuracy of rendering all views at 1 to 4 samples with OIDN "
    words += f"in {_range(ratios)} of the time" if ratios else "on no scene"
    words += f" on {len(ratios)} of {len(known)} scenes, and not all of them on the others" if lost and ratios else ""
    return words + f". A quarter or less: {met} of {len(known)} scenes; an eighth or less: {stretch} of {len(known)}."


def _range(ratios: Sequence[float]) -> str:
    low, high = (f"{ratio:.0%}" if ratio >= 0.1 else f"{ratio:.1%}" for ratio in (min(ratios), max(ratios)))
    return low if low == high else f"{low} to {high}"


def losses(chart: Chart) -> list[str]:
    """A sentence for every method that our default loses to somewhere, most often first; one if there is none."""
    ours, played = chart.settings.ours, collections.Counter[Key]()
    lost: dict[Key, dict[str, list[int]]] = collections.defaultdict(dict)
    for scene in chart.scenes:
        for duel in scene.by(chart.metric).versus:
            played[duel.curve] += 1
            if duel.outcome == "loss":
                lost[duel.curve].setdefault(scene.scene, []).append(duel.samples)
    times: dict[Key, int] = {key: sum(map(len, places.values())) for key, places in lost.items()}
    return [f"{label(key, ours)}: wins {times[key]} of {played[key]} times ({_places(lost[key])})"
            for key in sorted(lost, key=lambda key: (key[0] != DIRECT, -times[key]))] or [
                f"{ours} loses to no method that was measured, at no accuracy, on no scene."]


def _places(samples_of: Mapping[str, Sequence[int]]) -> str:
    return "; ".join(f"{scene} at {', '.join(map(str, sorted(samples)))}" for scene, samples in samples_of.items())


def opening(chart: Chart) -> str:
    """How long opening a scene takes, which the time axis leaves out."""
    seconds = [statistics.median(cell.open_seconds for cell in scene.cells) for scene in chart.scenes]
    return f"{min(seconds):.1f} to {max(seconds):.1f} s" if len(seconds) > 1 else f"{seconds[0]:.1f} s"


def duels_with(main: Analysis, role: str) -> list[Duel]:
    """Our method against those of a role, the denoised direct render first."""
    found = [duel for duel in main.versus if duel.role == role]
    return sorted(found, key=lambda duel: (duel.curve != RIVAL, duel.samples)) if role == DIRECT else found
