"""The chart as a page: one HTML file, no script, nothing loaded from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

from lfsr_lab.experiments.chart import findings
from lfsr_lab.experiments.chart.analysis import RIVAL, STRETCH, TARGET
from lfsr_lab.experiments.chart.panels import drawn, label, panels
from lfsr_lab.experiments.chart.records import DIRECT, LOW, Analysis, Cell, Chart, Duel
from lfsr_lab.experiments.chart.tables import known_metrics, metric_text, needs
from lfsr_lab.experiments.engine.plots import time_text
from lfsr_lab.experiments.engine.report import count, inline_svg, page_html

LOSSES_SHOWN = 6


def page(chart: Chart) -> str:
    """The whole HTML file."""
    metrics = known_metrics(chart.scenes)
    rivals = sorted(chart.settings.direct_methods, key=lambda name: name != RIVAL[1])
    return page_html(
        "chart.html", chart=chart, findings=findings, metrics=metrics, losses_shown=LOSSES_SHOWN, count=count,
        pictures=[inline_svg(drawn([panel]), panel.title) for panel in panels(chart)],
        direct=[(label((DIRECT, name), chart.settings.ours), name == RIVAL[1], _direct_rows(chart, name))
                for name in rivals],
        goals=[_goal_row(row) for row in findings.goals(chart)],
        others=[(scene.scene, [_duel(duel, chart) for duel in findings.duels_with(scene.by(chart.metric), LOW)],
                 [_duel(duel, chart) for duel in scene.by(chart.metric).reverse]) for scene in chart.scenes],
        numbers=[(scene, [_cell(cell, chart, metrics) for cell in scene.cells]) for scene in chart.scenes])


def _direct_rows(chart: Chart, rival: str) -> list[list[str]]:
    """Our method against one way of direct rendering; a scene's name stands in its first row."""
    return [[scene.scene if index == 0 else "", *_duel(duel, chart)[1:]]
            for scene in chart.scenes for index, duel in enumerate(_duels(scene.by(chart.metric), rival))]


def _duels(main: Analysis, rival: str) -> list[Duel]:
    return [duel for duel in findings.duels_with(main, DIRECT) if duel.method == rival]


def _duel(duel: Duel, chart: Chart) -> list[str]:
    return [label(duel.curve, chart.settings.ours), str(duel.samples), f"{duel.value:.3f}", time_text(duel.seconds),
            *needs(duel, time_text, 2), duel.outcome]


def _goal_row(row: findings.GoalRow) -> list[str]:
    words = ""
    if row.known:
        missed = row.ratio is None or row.ratio > TARGET
        words = "missed" if missed else "an eighth" if row.ratio is not None and row.ratio <= STRETCH else "a quarter"
    return [row.scene, _ratio(row.ratio, row.known), _ratio(row.opened, row.known), words, row.best]


def _ratio(ratio: float | None, known: bool) -> str:
    return "not measured" if not known else "never" if ratio is None else f"{ratio:.2f}"


def _cell(cell: Cell, chart: Chart, metrics: Sequence[str]) -> list[str]:
    spread = cell.seconds
    seconds = f"{cell.render + cell.second_stage:.2f} ({spread.least:.2f}–{spread.most:.2f})"
    return [label((cell.role, cell.method), chart.settings.ours), str(cell.samples), seconds,
            f"{1000 * cell.second_stage:.0f}", f"{1000 * cell.stage_seconds['upscale']:.1f}",
            *(metric_text(cell, metric) for metric in metrics)]
