"""The images of a chart and its page: cost across, error up, both logarithmic; a method looks the same everywhere."""

from __future__ import annotations

import base64
import dataclasses
import io
import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.images.color import srgb_encode
from lfsr_lab.experiments.chart import cells, findings
from lfsr_lab.experiments.chart.analysis import DIRECT, LOW, Cell, Chart, Key, SceneRow, mean_cells
from lfsr_lab.experiments.chart.cells import Settings
from lfsr_lab.experiments.chart.findings import RIVAL, label
from lfsr_lab.experiments.engine import plots, truth
from lfsr_lab.experiments.engine.plots import Curve
from lfsr_lab.experiments.engine.records import REFERENCE
from lfsr_lab.experiments.engine.report import inline_svg, page_html

RULES = {"largest": -1, "median": 0.5, "smallest": 0}
FLIP_MOST = 0.7  # HDR-FLIP that is drawn white


@dataclasses.dataclass(frozen=True)
class Row:
    """One lens, as both methods show it."""

    title: str  # kind of equality, rule, scene and lens
    names: tuple[str, str]  # ours and the rival, with samples
    errors: tuple[float, float]  # HDR-FLIP of this lens, means over seeds
    reference: Array  # (py, px, 3) scene-linear, mean of both halves
    images: tuple[Array, Array]  # (py, px, 3) scene-linear, of seed 0


@dataclasses.dataclass(frozen=True)
class Crops:
    rows: tuple[Row, ...]

    def png(self) -> bytes:
        """Return the picture: reference, both images and both error maps of every row."""
        figure, grid = plots.sheet(10.5, 2.35 * len(self.rows), len(self.rows), 5)
        for axes, row in zip(grid, self.rows, strict=True):
            maps = [truth.flip_map(image, row.reference) for image in row.images]
            shown = [srgb_encode(image) for image in (row.reference, *row.images)]
            titles = ["reference", *row.names, *(f"HDR-FLIP {error:.3f}" for error in row.errors)]
            for place, picture, title in zip(axes, [*shown, *maps], titles, strict=True):
                place.imshow(picture, cmap="magma", vmin=0, vmax=FLIP_MOST, interpolation="nearest")
                place.set_title(plots.broken(title), fontsize=9)
                place.set_xticks([])
                place.set_yticks([])
            axes[0].set_ylabel(row.title, fontsize=9)
        file = io.BytesIO()
        figure.savefig(file, dpi=plots.DPI, metadata={"Software": None}, pil_kwargs={"optimize": True})
        return file.getvalue()


def chosen_crops(chart: Chart, settings: Settings, scenes: Sequence[Path]) -> Crops | None:
    """Return the crops of a chart; None where ours or the rival was not measured on every scene."""
    pairs = [_pairs(chart, row) for row in chart.scenes]
    if not all(pairs):
        return None
    rows = []
    for kind in pairs[0]:
        candidates = [(difference, path, pair[kind], index) for path, pair in zip(scenes, pairs, strict=True)
                      for index, difference in enumerate(np.subtract(
                     *(_flips(settings, path, cell) for cell in reversed(pair[kind]))))]
        candidates.sort(key=lambda candidate: candidate[0])
        for rule, share in RULES.items():
            _, path, pair, index = candidates[-1 if share < 0 else math.floor(share * (len(candidates) - 1))]
            rows.append(_row(settings, path, pair, index, f"{kind}\n{rule} difference", chart.settings.ours))
    return Crops(tuple(rows))


Pair = tuple[Cell, Cell]  # of ours and of the rival


def _pairs(chart: Chart, scene: SceneRow) -> dict[str, Pair]:
    """Return the cells that are compared, by kind of equality."""
    ours = [cell for cell in scene.cells if cell.key == (LOW, chart.settings.ours)]
    rival = max((cell for cell in scene.cells if cell.key == RIVAL), key=lambda cell: cell.samples, default=None)
    if not ours or rival is None:
        return {}

    def nearest(of: Callable[[Cell], float]) -> Pair:
        return min(ours, key=lambda cell: abs(math.log(of(cell) / of(rival)))), rival

    cost = ("equal time", lambda cell: cell.seconds.mean) if chart.timed else ("equal rays", lambda cell: cell.rays)
    return {cost[0]: nearest(cost[1]), "equal error": nearest(lambda cell: cell.errors[truth.FLIP].mean)}


def _flips(settings: Settings, scene: Path, cell: Cell) -> Array:
    render = _render(settings, scene, cell)
    values = cells.measured(render, cell.method, truth.Truth(settings.output / scene.stem / REFERENCE)).values
    return np.mean(values[truth.FLIP], 0)


def _render(settings: Settings, scene: Path, cell: Cell) -> cells.Render:
    return next(render for render in cells.renders(settings, scene)
                if (render.role, render.jobs[0].sampling.samples) == (cell.role, cell.samples))


def _row(settings: Settings, scene: Path, pair: Pair, index: int, title: str, ours: str) -> Row:
    reference = truth.Truth(settings.output / scene.stem / REFERENCE)
    images = [reference.finished(_render(settings, scene, cell).folders[0], cell.method)[index] for cell in pair]
    names = [f"{name}, {cell.samples} samples" for name, cell in zip(("ours", label(RIVAL, ours)), pair, strict=True)]
    errors = [float(_flips(settings, scene, cell)[index]) for cell in pair]
    mean = (reference.halves[0][index] + reference.halves[1][index]) / 2
    return Row(f"{title}\n{scene.stem}", (names[0], names[1]), (errors[0], errors[1]), mean, (images[0], images[1]))


STYLES = list(zip(plots.COLORS, plots.MARKERS, strict=True))
COSTS = {True: "render and second stage, end to end →", False: "rays per finished pixel →"}  # by whether it is seconds


@dataclasses.dataclass(frozen=True)
class Panel:
    title: str
    cells: Sequence[Cell]
    noise: Mapping[str, float]  # of the reference, by error
    measure: str  # or PARTS for bias and variance of the same methods
    seconds: bool  # whether the cost is seconds, else rays per finished pixel

    @property
    def parts(self) -> bool:
        return self.measure in truth.PARTS

    @property
    def error(self) -> str:
        return "bias² and variance, parts of relMSE" if self.parts else truth.LABELS[self.measure]

    @property
    def words(self) -> str:
        return f"{self.title}: {self.error}, by {'time' if self.seconds else 'rays'}"


def overview(chart: Chart) -> list[Panel]:
    """Return every error against every cost, then bias and variance: means over the scenes."""
    title = f"Mean of {len(chart.scenes)} scenes" if len(chart.scenes) > 1 else chart.scenes[0].scene
    noise = {name: statistics.fmean(scene.reference.noise[name] for scene in chart.scenes) for name in truth.MEASURES}
    cells = mean_cells(chart.scenes)
    several = any(truth.BIAS in cell.errors for cell in cells)
    return [Panel(title, cells, noise, measure, seconds)
            for measure in (*truth.MEASURES, *((truth.BIAS,) if several else ())) for seconds in costs(chart)]


def of_scene(chart: Chart, scene: SceneRow) -> list[Panel]:
    """Return the panels of one scene: SSIM and relMSE."""
    return [Panel(scene.scene, scene.cells, scene.reference.noise, measure, chart.timed)
            for measure in (truth.SSIM, truth.RELMSE)]


def costs(chart: Chart) -> tuple[bool, ...]:
    """Return the costs that are known: seconds where everything is timed, and rays."""
    return (True, False) if chart.timed else (False,)


def image(chart: Chart) -> str:
    environment, settings = chart.environment, chart.settings
    return drawn(chart, overview(chart), f"Ours: {settings.ours}. Numbers: samples per pixel. Bars: 95 % intervals "
                 f"over seeds and lenses. Display {settings.display}, {settings.seeds} "
                 f"seed{'s' if settings.seeds > 1 else ''}, {environment.cores} cores of {environment.cpu}.")


def page(chart: Chart, crops: Crops | None) -> str:
    """Return the chart as one HTML file, without a script, that loads nothing from elsewhere."""
    images = [inline_svg(drawn(chart, [panel]), panel.words) for panel in overview(chart)]
    scenes = [inline_svg(drawn(chart, [panel]), panel.words)
              for scene in chart.scenes for panel in of_scene(chart, scene)] if len(chart.scenes) > 1 else []
    picture = base64.b64encode(crops.png()).decode() if crops else ""
    return page_html("chart.html", chart=chart, findings=findings, images=images, scenes=scenes, crops=crops,
                     picture=picture)


def drawn(chart: Chart, shown: Sequence[Panel], footer: str = "") -> str:
    figure, grid = plots.panel_sheet(len(shown), footer=footer)
    # Of every method drawn with its name, colour and marker: ours, direct rendering, and others in order.
    keys: list[Key] = [(LOW, chart.settings.ours), RIVAL, *((DIRECT, name) for name in chart.settings.direct_methods),
                       *((LOW, name) for name in chart.settings.methods)]
    styles = dict(zip(dict.fromkeys(keys), STYLES, strict=False))
    for axes, panel in zip(grid, shown, strict=True):
        named = [curve for key, look in styles.items() for curve in _curves(chart, panel, key, look)]
        noise = panel.noise[truth.RELMSE if panel.parts else panel.measure]
        ours = [cell for cell in panel.cells if cell.key == (LOW, chart.settings.ours)]
        plots.error_axis(axes, *plots.limits([*(y for curve in named for y in curve.y), noise], 0.06))
        plots.cost_axis(axes, *plots.limits([x for curve in named for x in curve.x], 0.04), panel.seconds)
        axes.grid(color=plots.GRID)
        axes.set_title(panel.title, loc="left", fontsize=16, weight="bold", pad=21)
        quiet: dict[str, Any] = {"fontsize": 12, "color": plots.QUIET, "textcoords": "offset points",
                                 "xycoords": "axes fraction"}
        axes.annotate(f"↓ {panel.error}", (0, 1), (0, 7), **quiet)
        axes.annotate(COSTS[panel.seconds], (1, 0), (0, -36), ha="right", **quiet)
        for index, curve in enumerate(reversed(named)):  # the first comes on top
            plots.draw_curve(axes, curve, 3 + index / 10)
        taken = plots.draw_noise(axes, noise)
        start = min(ours, key=lambda cell: cell.samples, default=None)
        if start:
            measure = truth.VARIANCE if panel.parts else panel.measure
            taken += plots.draw_slopes(axes, measure, (_cost(panel, start), start.errors[measure].mean))
        plots.name_curves(axes, named, taken)
    return plots.svg(figure)


def _curves(chart: Chart, panel: Panel, key: Key, look: tuple[str, str]) -> list[Curve]:
    """Return a method's curve; of bias and variance both, for ours and direct rendering with OIDN."""
    us: Key = (LOW, chart.settings.ours)
    if panel.parts and key not in (us, RIVAL):
        return []
    name, curves = "ours" if key == us else findings.label(key, chart.settings.ours), []
    for measure in truth.PARTS if panel.parts else (panel.measure,):
        cells = [cell for cell in panel.cells if cell.key == key and measure in cell.errors
                 and cell.errors[measure].mean > 0]
        color, marker = STYLES[STYLES.index(look) + (2 if measure == truth.VARIANCE else 0)]
        words = f"{name}: {'variance' if measure == truth.VARIANCE else 'bias²'}" if panel.parts else name
        if cells:
            errors = [cell.errors[measure] for cell in cells]
            bottom = min(error.mean for error in errors) / 10
            curves.append(Curve(
                words, color, marker, [_cost(panel, cell) for cell in cells], [error.mean for error in errors],
                [(cell.seconds.low, cell.seconds.high) for cell in cells if cell.seconds] if panel.seconds else [],
                [(max(error.low, bottom), max(error.high, bottom)) for error in errors],
                [str(cell.samples) for cell in cells] if key in (us, RIVAL) and not panel.parts else (), key == us))
    return curves


def _cost(panel: Panel, cell: Cell) -> float:
    return cell.seconds.mean if panel.seconds and cell.seconds else cell.rays
