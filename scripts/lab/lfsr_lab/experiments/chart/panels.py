"""Which curves a chart draws, in which colours: the same method looks the same in every panel."""

from __future__ import annotations

import collections
import dataclasses
import statistics
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from lfsr_lab.experiments.chart.analysis import RIVAL, curves, mean_points, pareto_front, points, sign_of
from lfsr_lab.experiments.chart.records import DIRECT, LOW, Cell, Chart, Key, Point, Role, SceneRow
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.plots import Curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLES = list(zip(plots.COLORS, plots.MARKERS, strict=True))
FRONT = "#f3dfa2"
AXES = {"ssim_eia_fg": "SSIM of the subject", "ssim_lens_fg": "SSIM of the subject, lens by lens",
        "ssim_views_fg": "SSIM of the views", "ssim_eia": "SSIM of everything",
        "ssim_lens": "SSIM of everything, lens by lens", "psnr_fg": "PSNR in dB", "flip": "−FLIP"}


def label(key: Key, ours: str) -> str:
    """A method as the page calls it."""
    role, name = key
    if role == DIRECT:
        return "every view" if name == "none" else f"every view +{name.upper() if name == RIVAL[1] else name}"
    return f"{name} (ours)" if name == ours else name


@dataclasses.dataclass(frozen=True)
class Panel:
    """What one panel of the chart shows: seconds across, a metric up."""

    title: str  # its heading
    axis: str  # what its values are
    curves: Sequence[Curve]  # methods with their names, the most important first
    front: Sequence[Point]  # points that no other point beats
    others: Sequence[Point]  # points of methods without a name
    ceiling: tuple[float, str] | None  # value and words of a line across
    toward_one: bool  # values end at 1, and their axis stretches towards it


def styles(chart: Chart) -> dict[Key, tuple[str, str]]:
    """Colour and marker of every method that is drawn with its name: ours, direct rendering, and who is on a front."""
    fixed: list[Key] = [(LOW, chart.settings.ours), RIVAL, (DIRECT, "none")]
    seen = collections.Counter(point.curve for scene in chart.scenes for point in scene.by(chart.metric).front)
    more = [key for key, _ in seen.most_common() if key not in fixed]
    return dict(zip([*fixed, *more], STYLES, strict=False))


def scene_panel(chart: Chart, scene: SceneRow, metric: str) -> Panel:
    """Panel of one scene by a metric, with intervals and the ceiling."""
    cells = {cell.key: cell for cell in scene.cells}
    panel = _panel(chart, points(scene.cells, metric), metric, cells)
    return dataclasses.replace(panel, title=scene.scene, ceiling=_ceiling([scene], metric))


def mean_panel(chart: Chart) -> Panel | None:
    """Panel of the mean over scenes; None where the scenes share no cell."""
    metric = chart.metric
    shared = mean_points(chart.scenes, metric)
    if not shared:
        return None
    return dataclasses.replace(_panel(chart, shared, metric, {}), title=f"Mean of {len(chart.scenes)} scenes",
                               ceiling=_ceiling(chart.scenes, metric))


def _panel(chart: Chart, every: Sequence[Point], metric: str, cells: Mapping[tuple[Role, str, int], Cell]) -> Panel:
    """Panel without title and ceiling; curves have the intervals of ``cells`` where there are any."""
    found, look, ours = curves(every), styles(chart), chart.settings.ours

    def curve(key: Key) -> Curve:
        mine = [cells[(*key, point.samples)] for point in found[key] if cells]
        return Curve(label(key, ours), *look[key], x=[point.seconds for point in found[key]],
                     y=[point.value for point in found[key]], halves=[cell.ci95.get(metric) for cell in mine],
                     spans=[(cell.seconds.least, cell.seconds.most) for cell in mine],
                     notes=[str(point.samples) for point in found[key]] if key in ((LOW, ours), RIVAL) else (),
                     bold=key == (LOW, ours))

    return Panel("", AXES[metric], [curve(key) for key in look if key in found], pareto_front(every),
                 [point for point in every if point.curve not in look], None, toward_one="ssim" in metric)


def _ceiling(scenes: Sequence[SceneRow], metric: str) -> tuple[float, str] | None:
    """Mean of the scenes' ceilings, as high as it is drawn, and the words at its line."""
    every = [part.ceiling for scene in scenes for part in scene.analysis if part.metric == metric]
    found = [ceiling for ceiling in every if ceiling]
    if len(found) < len(every):
        return None
    value = statistics.fmean(ceiling.value for ceiling in found)
    return sign_of(metric) * value, f"the best from a low resolution without noise: {value:.3f}"


def panels(chart: Chart) -> list[Panel]:
    """The mean where there are several scenes, then every scene."""
    mean = mean_panel(chart) if len(chart.scenes) > 1 else None
    return [panel for panel in (mean, *(scene_panel(chart, scene, chart.metric) for scene in chart.scenes)) if panel]


def picture(chart: Chart) -> str:
    """All panels as one SVG."""
    environment = chart.environment
    return drawn(panels(chart), "Pale band: Pareto front. Numbers: samples per pixel. Grey: other methods. Display "
                 f"{chart.settings.display}, {environment.cores} cores of {environment.cpu}.")


def drawn(shown: Sequence[Panel], footer: str = "") -> str:
    """Panels as one SVG."""
    figure, grid = plots.panel_sheet(len(shown), footer=footer)
    for axes, panel in zip(grid, shown, strict=True):
        _draw(axes, panel)
    return plots.svg(figure)


def _draw(axes: Axes, panel: Panel) -> None:
    _limits(axes, panel)
    axes.grid(color=plots.GRID)
    axes.set_title(panel.title, loc="left", fontsize=16, weight="bold", pad=21)
    quiet: dict[str, Any] = {"fontsize": 12, "color": plots.QUIET, "textcoords": "offset points"}
    axes.annotate(f"↑ {panel.axis}", (0, 1), (0, 7), xycoords="axes fraction", **quiet)
    axes.annotate("render and second stage, end to end →", (1, 0), (0, -36), xycoords="axes fraction", ha="right",
                  **quiet)
    if panel.front:
        x, y = [point.seconds for point in panel.front], [point.value for point in panel.front]
        axes.step([*x, axes.get_xlim()[1]], [*y, y[-1]], where="post", color=FRONT, linewidth=9, zorder=2)
    axes.plot([point.seconds for point in panel.others], [point.value for point in panel.others], ".",
              color=plots.FAINT, zorder=2.5)
    for index, curve in enumerate(reversed(panel.curves)):  # the first comes on top
        plots.draw_curve(axes, curve, 3 + index / 10)
    plots.name_curves(axes, panel.curves, _draw_ceiling(axes, panel))


def _draw_ceiling(axes: Axes, panel: Panel) -> list[Any]:
    """Draw the line across; its words, if there is one."""
    if panel.ceiling is None:
        return []
    value, words = panel.ceiling
    axes.axhline(value, color=plots.INK, linewidth=1.5, linestyle=(0, (1.3, 2.7)), zorder=2.7)
    return [axes.annotate(words, (0, value), (2, 5), xycoords=("axes fraction", "data"), textcoords="offset points",
                          fontsize=11.5, zorder=9)]


def _limits(axes: Axes, panel: Panel) -> None:
    """Room for all curves and the ceiling."""
    seconds = [second for curve in panel.curves for second in curve.x] + [point.seconds for point in panel.front]
    values = [value for curve in panel.curves for value in curve.y] + [point.value for point in panel.front]
    values += [panel.ceiling[0]] if panel.ceiling else []
    heights = plots.height(values) if panel.toward_one else values
    low, high = min(heights), max(heights)
    space = max(high - low, 1e-3) * 0.05
    plots.time_axis(axes, min(seconds) / 1.15, max(seconds) * 1.15)
    plots.value_axis(axes, low - space, high + 1.6 * space, panel.toward_one)
