"""The image of a chart and its page: seconds across, accuracy up; the same method looks the same in every panel."""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lfsr_lab.experiments.chart import findings
from lfsr_lab.experiments.chart.analysis import RIVAL, average, curves, mean_cells, pareto_front, points
from lfsr_lab.experiments.chart.records import DIRECT, LOW, Cell, Chart, Key, Point, SceneRow
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.plots import Curve
from lfsr_lab.experiments.engine.report import inline_svg, page_html

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLES = list(zip(plots.COLORS, plots.MARKERS, strict=True))
FRONT = "#f3dfa2"
AXES = {"ssim_eia_fg": "SSIM of the subject", "ssim_lens_fg": "SSIM of the subject, lens by lens"}


@dataclasses.dataclass(frozen=True)
class Panel:
    """What one panel of the chart shows."""

    title: str
    cells: Sequence[Cell]
    ceiling: float | None  # value of the line across


def panels(chart: Chart) -> list[Panel]:
    """Return the mean where there are several scenes that share a cell, then every scene."""
    found = [Panel(scene.scene, scene.cells, _ceiling(chart, [scene])) for scene in chart.scenes]
    shared = mean_cells(chart.scenes)
    if len(chart.scenes) > 1 and points(shared, chart.metric):
        found.insert(0, Panel(f"Mean of {len(chart.scenes)} scenes", shared, _ceiling(chart, chart.scenes)))
    return found


def _ceiling(chart: Chart, scenes: Sequence[SceneRow]) -> float | None:
    """Return the mean of the scenes' ceilings, None where one of them has none."""
    found = [scene.by(chart.metric).ceiling for scene in scenes]
    return average([ceiling.value if ceiling else None for ceiling in found])


def styles(chart: Chart) -> dict[Key, tuple[str, str]]:
    """Return colour and marker of every method drawn with its name: ours, direct rendering, and who is on a front."""
    fixed: list[Key] = [(LOW, chart.settings.ours), RIVAL, (DIRECT, "none")]
    seen = collections.Counter(point.curve for scene in chart.scenes for point in scene.by(chart.metric).front)
    more = [key for key, _ in seen.most_common() if key not in fixed]
    return dict(zip([*fixed, *more], STYLES, strict=False))


def image(chart: Chart) -> str:
    """Return all panels as one SVG."""
    environment = chart.environment
    return drawn(chart, panels(chart), "Pale band: Pareto front. Numbers: samples per pixel. Grey: other methods. "
                 f"Display {chart.settings.display}, {environment.cores} cores of {environment.cpu}.")


def page(chart: Chart) -> str:
    """Return the chart as one HTML file, without a script, that loads nothing from elsewhere."""
    images = [inline_svg(drawn(chart, [panel]), panel.title) for panel in panels(chart)]
    return page_html("chart.html", chart=chart, findings=findings, images=images)


def drawn(chart: Chart, shown: Sequence[Panel], footer: str = "") -> str:
    """Return panels as one SVG."""
    figure, grid = plots.panel_sheet(len(shown), footer=footer)
    for axes, panel in zip(grid, shown, strict=True):
        _draw(axes, chart, panel)
    return plots.svg(figure)


def _draw(axes: Axes, chart: Chart, panel: Panel) -> None:
    every, look = points(panel.cells, chart.metric), styles(chart)
    found, front = curves(every), pareto_front(every)
    named = [_curve(chart, panel, key, found[key], look[key]) for key in look if key in found]
    _limits(axes, [*front, *(point for key in look for point in found.get(key, []))], panel.ceiling)
    _words(axes, panel.title, AXES[chart.metric])
    x, y = [point.seconds for point in front], [point.value for point in front]
    axes.step([*x, axes.get_xlim()[1]], [*y, y[-1]], where="post", color=FRONT, linewidth=9, zorder=2)
    others = [point for point in every if point.curve not in look]
    axes.plot([point.seconds for point in others], [point.value for point in others], ".", color=plots.FAINT,
              zorder=2.5)
    for index, curve in enumerate(reversed(named)):  # the first comes on top
        plots.draw_curve(axes, curve, 3 + index / 10)
    plots.name_curves(axes, named, _draw_ceiling(axes, panel.ceiling))


def _curve(chart: Chart, panel: Panel, key: Key, line: Sequence[Point], look: tuple[str, str]) -> Curve:
    """Return a method's curve, with bars where the panel's cells have intervals."""
    cells = {cell.key: cell for cell in panel.cells if cell.ci95}
    barred = [cells[(*key, point.samples)] for point in line if cells]
    us = (LOW, chart.settings.ours)
    return Curve(findings.label(key, chart.settings.ours), *look, x=[point.seconds for point in line],
                 y=[point.value for point in line], halves=[cell.ci95.get(chart.metric) for cell in barred],
                 spans=[(cell.seconds.least, cell.seconds.most) for cell in barred],
                 notes=[str(point.samples) for point in line] if key in (us, RIVAL) else (), bold=key == us)


def _words(axes: Axes, title: str, axis: str) -> None:
    axes.grid(color=plots.GRID)
    axes.set_title(title, loc="left", fontsize=16, weight="bold", pad=21)
    quiet: dict[str, Any] = {"fontsize": 12, "color": plots.QUIET, "textcoords": "offset points",
                             "xycoords": "axes fraction"}
    axes.annotate(f"↑ {axis}", (0, 1), (0, 7), **quiet)
    axes.annotate("render and second stage, end to end →", (1, 0), (0, -36), ha="right", **quiet)


def _draw_ceiling(axes: Axes, value: float | None) -> list[Any]:
    """Draw the line across, and return its words, if there is one."""
    if value is None:
        return []
    axes.axhline(value, color=plots.INK, linewidth=1.5, linestyle=(0, (1.3, 2.7)), zorder=2.7)
    words = f"the best from a low resolution without noise: {value:.3f}"
    return [axes.annotate(words, (0, value), (2, 5), xycoords=("axes fraction", "data"), textcoords="offset points",
                          fontsize=11.5, zorder=9)]


def _limits(axes: Axes, shown: Sequence[Point], ceiling: float | None) -> None:
    """Make room for points and the ceiling."""
    seconds = [point.seconds for point in shown]
    heights = plots.height([point.value for point in shown] + ([] if ceiling is None else [ceiling]))
    low, high = min(heights), max(heights)
    space = max(high - low, 1e-3) * 0.05
    plots.time_axis(axes, min(seconds) / 1.15, max(seconds) * 1.15)
    plots.value_axis(axes, low - space, high + 1.6 * space)
