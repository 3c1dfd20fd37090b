"""What a chart says: sentences and tables made from its numbers, the same for its page and its Markdown file."""

from __future__ import annotations

import collections
import dataclasses
import statistics
from collections.abc import Iterator, Sequence
from itertools import groupby

from lfsr_lab.experiments.chart.analysis import RIVAL, mean_cells, pareto_front, points
from lfsr_lab.experiments.chart.records import DIRECT, Cell, Chart, Duel, Goal, Key, Point, SceneRow
from lfsr_lab.experiments.engine.plots import time_text
from lfsr_lab.experiments.engine.report import UNKNOWN, count, markdown_table, number

LITTLE_MORE, LEAST_GAIN = 1.15, 0.005  # steps of advice smaller than these are not worth a line
METRICS = ("ssim_eia", "ssim_eia_fg", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain",
           "ssim_ceiling", "ssim_lens_plain", "ssim_lens_ceiling", "flip")
MARKS = {"win": "✔ win", "loss": "✘ loss"}
AGAINST_US = ("scene", "samples", "SSIM", "it takes", "we take", "ours ÷ its", "")


@dataclasses.dataclass(frozen=True)
class Table:
    """One table."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    align: str = "lr"  # a letter per column, "l" or "r"; the last one stands for all further columns

    @property
    def left(self) -> list[int]:
        """Numbers of the columns of text."""
        return [index for index, letter in enumerate(self.align) if letter == "l"]


def label(key: Key, ours: str) -> str:
    """Return a method as the page calls it."""
    role, name = key
    if role == DIRECT:
        return "every view" if name == "none" else f"every view +{name.upper() if name == RIVAL[1] else name}"
    return f"{name} (ours)" if name == ours else name


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
    duels = [duel for scene in chart.scenes for duel in scene.by(chart.metric).versus]
    every, ours = collections.Counter(duel.curve for duel in duels), chart.settings.ours
    lost = collections.Counter(duel.curve for duel in duels if duel.outcome == "loss")
    return [f"{label(key, ours)}: wins {lost[key]} of {every[key]} times"
            for key in sorted(lost, key=lambda key: (key[0] != DIRECT, -lost[key]))] or [
                f"{ours} loses to no method that was measured, at no accuracy, on no scene."]


def opening(chart: Chart) -> str:
    """Return how long opening a scene takes, which the time axis leaves out."""
    seconds = [statistics.median(cell.open_seconds for cell in scene.cells) for scene in chart.scenes]
    return f"{min(seconds):.1f} to {max(seconds):.1f} s" if len(seconds) > 1 else f"{seconds[0]:.1f} s"


def markdown(chart: Chart) -> str:
    """Return the headline and all tables as Markdown."""
    tables = [advice(chart), *duels(chart), target(chart), *numbers(chart), costs(chart)]
    parts = [[f"## {table.title}", "", *markdown_table(table.header, table.rows, table.align), ""] for table in tables]
    return "\n".join([headline(chart), "", *(line for part in parts for line in part)])


def advice(chart: Chart) -> Table:
    """Return which method to use when: the front of the mean in steps."""
    front = worth_a_step(pareto_front(points(mean_cells(chart.scenes), chart.metric)))
    steps = [list(group) for _, group in groupby(front, key=lambda point: point.curve)]
    return Table("Which method when", ("you can wait", "use", "samples", "SSIM"), [
        [f"from {time_text(step[0].seconds)}", label(step[0].curve, chart.settings.ours),
         ", ".join(str(point.samples) for point in step),
         " to ".join(dict.fromkeys(f"{point.value:.3f}" for point in (step[0], step[-1])))] for step in steps], "llr")


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


def duels(chart: Chart) -> list[Table]:
    """Return a table of ours against every other method, direct rendering with OIDN first."""
    rows: dict[Key, list[list[str]]] = {}
    for scene in chart.scenes:
        for duel in scene.by(chart.metric).versus:
            row = [scene.scene, str(duel.samples), f"{duel.value:.3f}", time_text(duel.seconds), *_needs(duel)]
            rows.setdefault(duel.curve, []).append([*row, MARKS[duel.outcome]])
    ours, rivals = chart.settings.ours, sorted(rows, key=lambda key: (key != RIVAL, key[0] != DIRECT))
    return [Table(f"{ours} against {label(key, ours)}", AGAINST_US, rows[key]) for key in rivals]


def _needs(duel: Duel) -> tuple[str, str]:
    """Return time and ratio of a duel: "never" where the accuracy is not reached, ≤ where only a bound is known."""
    if duel.needs_seconds is None:
        return "never", UNKNOWN
    at_most = "≤ " if duel.bound else ""
    return at_most + time_text(duel.needs_seconds), at_most + number(duel.ratio, digits=2)


def target(chart: Chart) -> Table:
    """Return how our method does against the target on every scene."""
    return Table("The target", ("scene", "ours ÷ its", "with opening", "", "best other method"),
                 [_target_row(chart, scene) for scene in chart.scenes], "lrrll")


def _target_row(chart: Chart, scene: SceneRow) -> list[str]:
    main = scene.by(chart.metric)
    goal, others = main.target, main.targets_of_others.items()
    ratios = [(found.worst_ratio, method) for method, found in others if found and found.worst_ratio is not None]
    best = "{1}: {0:.2f}".format(*min(ratios)) if ratios else "none"
    met = goal and ("✔ an eighth" if goal.stretch_met else "✔ a quarter" if goal.met else "✘ missed")
    return [scene.scene, _ratio(goal), _ratio(main.target_with_opening), met or "", best]


def _ratio(goal: Goal | None) -> str:
    return "not measured" if goal is None else "never" if goal.worst_ratio is None else f"{goal.worst_ratio:.2f}"


def numbers(chart: Chart) -> Iterator[Table]:
    """Yield every cell with its times and metrics: of the mean where there are several scenes, then of every scene."""
    if len(chart.scenes) > 1:
        yield _numbers(f"Mean of {len(chart.scenes)} scenes", mean_cells(chart.scenes), chart)
    for scene in chart.scenes:
        shown = "every lens" if scene.reference.lenses is None else f"{scene.reference.lenses} lenses"
        yield _numbers(f"{scene.scene}: subject in {scene.p:.0%} of the lenses, reference of {scene.reference.samples} "
                       f"samples, {shown}", scene.cells, chart)


def _numbers(title: str, cells: Sequence[Cell], chart: Chart) -> Table:
    metrics = [name for name in METRICS if any(cell.metrics.get(name) is not None for cell in cells)]
    header = ("method", "samples", "scale", "seconds (spread)", "second stage ms", "method ms", *metrics)
    return Table(title, header, [
        [label((cell.role, cell.method), chart.settings.ours), str(cell.samples), str(cell.scale),
         f"{cell.seconds.median:.2f} ({cell.seconds.least:.2f}–{cell.seconds.most:.2f})",
         f"{1000 * cell.second_stage:.0f}", f"{1000 * cell.stage_seconds['upscale']:.1f}",
         *(number(cell.metrics.get(name), cell.ci95.get(name), 1 if name == "psnr_fg" else 4) for name in metrics)]
        for cell in cells])


def costs(chart: Chart) -> Table:
    """Return what each method costs."""
    header = ("method", "multiply-adds per low pixel", "parameters", "in a process of its own s")
    return Table("What each method costs", header, [
        [cost.method, count(cost.multiply_adds_per_low_pixel), count(cost.parameters),
         number(cost.fresh_process_seconds, digits=1)] for cost in chart.methods])
