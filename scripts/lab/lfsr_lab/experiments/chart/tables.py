"""The chart as Markdown tables: every method and metric, and who wins."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence

from lfsr_lab.experiments.chart.records import DIRECT, Cell, Chart, Duel, MethodCost, SceneRow
from lfsr_lab.experiments.engine.report import UNKNOWN, count, markdown_table, number

METRICS = ("ssim_eia", "ssim_eia_fg", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain",
           "ssim_ceiling", "ssim_lens_plain", "ssim_lens_ceiling", "flip")
DIGITS = {"psnr_fg": 1}
HEAD = ("method", "spp", "s", "render s", "second stage ms", "method ms", "multiply-adds", "parameters")
DUELS = ("scene", "rival", "spp", "its value", "its s", "ours needs s", "ours / its", "outcome")


def markdown(chart: Chart) -> str:
    """All tables of a chart."""
    costs = {cost.method: cost for cost in chart.methods}
    parts = [] if len(chart.scenes) < 2 else [
        f"## Mean of {len(chart.scenes)} scenes ({', '.join(scene.scene for scene in chart.scenes)})", "",
        *_table(list(shared_cells(chart.scenes)), costs, known_metrics(chart.scenes)), ""]
    parts += [f"## {chart.settings.ours} against direct high-resolution rendering, {chart.metric}", "",
              *markdown_table(DUELS, _duels(chart)), ""]
    for scene in chart.scenes:
        parts += [f"## {scene.scene}", "", f"p = {scene.p:.3f}; reference of {scene.reference.samples} samples, "
                  f"{scene.reference.shown}; ± is the 95 % interval over lenses.", "",
                  *_table([[cell] for cell in scene.cells], costs, known_metrics([scene])), ""]
    return "\n".join(parts) + "\n"


def known_metrics(scenes: Sequence[SceneRow]) -> list[str]:
    """Those of METRICS that any of the scenes has: whole references and sampled ones give different ones."""
    return [name for name in METRICS if any(scene.knows(name) for scene in scenes)]


def shared_cells(scenes: Sequence[SceneRow]) -> Iterator[list[Cell]]:
    """The cells that every scene has, in the order of the first scene's; each with its like of the other scenes."""
    tables = [{cell.key: cell for cell in scene.cells} for scene in scenes]
    for key in tables[0]:
        if all(key in table for table in tables):
            yield [table[key] for table in tables]


def _table(rows: Sequence[Sequence[Cell]], costs: dict[str, MethodCost], metrics: Sequence[str]) -> list[str]:
    return markdown_table((*HEAD, *metrics), (_row(cells, costs, metrics) for cells in rows))


def _row(cells: Sequence[Cell], costs: dict[str, MethodCost], metrics: Sequence[str]) -> list[object]:
    """One line: geometric means of times, means of metrics; a single cell has its intervals."""
    first, cost = cells[0], costs.get(cells[0].method)
    render, second, own = (_geometric(values) for values in (
        [cell.render for cell in cells], [cell.second_stage for cell in cells],
        [cell.stage_seconds["upscale"] for cell in cells]))
    values = [metric_text(first, name) if len(cells) == 1 else _mean(cells, name) for name in metrics]
    return [first.method, first.samples, first.scale, f"{render:.2f}", f"{1000 * second:.0f}", f"{1000 * own:.1f}",
            count(cost.multiply_adds_per_low_pixel if cost else None),
            count(cost.parameters if cost else None), *values]


def _geometric(values: Sequence[float]) -> float:
    return statistics.geometric_mean(values) if min(values) > 0 else statistics.fmean(values)


def _mean(cells: Sequence[Cell], name: str) -> str:
    values = [value for cell in cells if (value := cell.value(name)) is not None]
    mean = statistics.fmean(values) if len(values) == len(cells) else None
    return number(mean, digits=DIGITS.get(name, 4))


def metric_text(cell: Cell, name: str) -> str:
    """A metric of a cell with its 95 % half-width."""
    return number(cell.value(name), cell.ci95.get(name), DIGITS.get(name, 4))


def _duels(chart: Chart) -> Iterator[list[object]]:
    """Our default against direct rendering, by scene."""
    for scene in chart.scenes:
        for duel in scene.by(chart.metric).versus:
            if duel.role == DIRECT:
                yield [scene.scene, duel.method, duel.samples, f"{duel.value:.4f}", f"{duel.seconds:.2f}",
                       *needs(duel, "{:.2f}".format, 3), duel.outcome]


def needs(duel: Duel, seconds_text: Callable[[float], str], digits: int) -> tuple[str, str]:
    """Time and ratio of a duel in words: "never" where the accuracy is not reached, ≤ where only a bound is known."""
    if duel.needs_seconds is None:
        return "never", UNKNOWN
    at_most = "≤ " if duel.bound else ""
    return at_most + seconds_text(duel.needs_seconds), at_most + number(duel.ratio, digits=digits)
