"""The tables of a chart, the same for its page and its Markdown file: who wins, every number, and costs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Sequence

from lfsr_lab.experiments.chart import findings
from lfsr_lab.experiments.chart.analysis import RIVAL, mean_cells
from lfsr_lab.experiments.chart.findings import label
from lfsr_lab.experiments.chart.panels import drawn, panels
from lfsr_lab.experiments.chart.records import DIRECT, LOW, Cell, Chart, Duel, Goal, SceneRow
from lfsr_lab.experiments.engine.plots import time_text
from lfsr_lab.experiments.engine.report import UNKNOWN, count, inline_svg, markdown_table, number, page_html

METRICS = ("ssim_eia", "ssim_eia_fg", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain",
           "ssim_ceiling", "ssim_lens_plain", "ssim_lens_ceiling", "flip")
LOSSES_SHOWN = 6
MARKS = {"win": "✔ win", "loss": "✘ loss"}
AGAINST_US = ("samples", "SSIM", "it takes", "we take", "ours ÷ its", "")
AGAINST_THEM = ("our samples", "our SSIM", "we take", "it takes", "its ÷ ours", "")


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


def page(chart: Chart) -> str:
    """Return the chart as one HTML file, without a script, that loads nothing from elsewhere."""
    return page_html("chart.html", chart=chart, findings=findings, advice=advice(chart), direct=direct(chart),
                     target=target(chart), others=others(chart), numbers=[*numbers(chart), costs(chart)],
                     pictures=[inline_svg(drawn(chart, [panel]), panel.title) for panel in panels(chart)],
                     losses_shown=LOSSES_SHOWN)


def markdown(chart: Chart) -> str:
    """Return the headline and all tables as Markdown."""
    tables = [advice(chart), *direct(chart), target(chart), *others(chart), *numbers(chart), costs(chart)]
    parts = [[f"## {table.title}", "", *markdown_table(table.header, table.rows, table.align), ""] for table in tables]
    return "\n".join([findings.headline(chart), "", *(line for part in parts for line in part)])


def advice(chart: Chart) -> Table:
    """Which method when."""
    return Table("Which method when", ("you can wait", "use", "SSIM"), findings.advice(chart), "llr")


def direct(chart: Chart) -> list[Table]:
    """Our method against each way of direct rendering on all scenes, the denoised one first."""
    ours = chart.settings.ours
    return [Table(f"{ours} against {label((DIRECT, name), ours)}", ("scene", *AGAINST_US),
                  _rows((scene.scene, duel) for scene in chart.scenes
                        for duel in scene.by(chart.metric).versus if duel.curve == (DIRECT, name)))
            for name in sorted(chart.settings.direct_methods, key=lambda name: name != RIVAL[1])]


def others(chart: Chart) -> Iterator[Table]:
    """Scene by scene: our method against all that finish low-resolution renders, and the reverse."""
    ours = chart.settings.ours
    for scene in chart.scenes:
        main = scene.by(chart.metric)
        yield Table(f"{scene.scene}: what we need to be as accurate as the others", ("method", *AGAINST_US),
                    _rows((label(duel.curve, ours), duel) for duel in main.versus if duel.role == LOW))
        yield Table(f"{scene.scene}: what the others need to be as accurate as we are", ("method", *AGAINST_THEM),
                    _rows((label(duel.curve, ours), duel) for duel in main.reverse))


def _rows(duels: Iterable[tuple[str, Duel]]) -> list[list[str]]:
    return [[name, str(duel.samples), f"{duel.value:.3f}", time_text(duel.seconds), *_needs(duel), MARKS[duel.outcome]]
            for name, duel in duels]


def _needs(duel: Duel) -> tuple[str, str]:
    """Return time and ratio of a duel: "never" where the accuracy is not reached, ≤ where only a bound is known."""
    if duel.needs_seconds is None:
        return "never", UNKNOWN
    at_most = "≤ " if duel.bound else ""
    return at_most + time_text(duel.needs_seconds), at_most + number(duel.ratio, digits=2)


def target(chart: Chart) -> Table:
    """How our method does against the target on every scene."""
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
    """Every cell with its times and metrics: of the mean where there are several scenes, and of every scene."""
    if len(chart.scenes) > 1:
        yield _numbers(f"Mean of {len(chart.scenes)} scenes", mean_cells(chart.scenes), chart)
    for scene in chart.scenes:
        yield _numbers(f"{scene.scene}: subject in {scene.p:.0%} of the lenses, reference of {scene.reference.samples} "
                       f"samples, {scene.reference.shown}", scene.cells, chart)


def _numbers(title: str, cells: Sequence[Cell], chart: Chart) -> Table:
    metrics = [name for name in METRICS if any(cell.metrics.get(name) is not None for cell in cells)]
    header = ("method", "samples", "scale", "seconds (spread)", "second stage ms", "method ms", *metrics)
    return Table(title, header, [
        [label((cell.role, cell.method), chart.settings.ours), str(cell.samples), str(cell.scale),
         f"{cell.seconds.median:.2f} ({cell.seconds.least:.2f}–{cell.seconds.most:.2f})",
         f"{1000 * cell.second_stage:.0f}", f"{1000 * cell.stage_seconds['upscale']:.1f}",
         *(_metric(cell, name) for name in metrics)] for cell in cells])


def _metric(cell: Cell, name: str) -> str:
    return number(cell.metrics.get(name), cell.ci95.get(name), 1 if name == "psnr_fg" else 4)


def costs(chart: Chart) -> Table:
    """What each method costs."""
    header = ("method", "multiply-adds per low pixel", "parameters", "in a process of its own s")
    return Table("What each method costs", header, [
        [cost.method, count(cost.multiply_adds_per_low_pixel), count(cost.parameters),
         number(cost.fresh_process_seconds, digits=1)] for cost in chart.methods])
