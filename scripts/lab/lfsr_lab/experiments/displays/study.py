"""Three kinds of displays: this way of making their images against the usual one, time and accuracy.

The real panels take many hours on a CPU; --width 384 is of panels of 384×216 pixels with the same sheets.
What is complete in OUT is not done again. OUT/displays.json has everything, displays.md tables, displays.svg and
displays-traced.svg figures: against every view, and against the panel's subpixels where it has a lens sheet.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfsr_core.base.records import write_record
from lfsr_lab.experiments.displays import measure
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.plots import svg
from lfsr_lab.experiments.engine.records import Cell, Records, Store, measured, to_stderr
from lfsr_lab.experiments.engine.report import Environment, environment, markdown_table, number, write_report

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WOVEN, TRACED = "woven", "traced"  # references: every view, woven or as it is; the panel's subpixels
HEADER = ("scene", "display", "way", "samples", "scale", "render", "rest", "CPU s", "PSNR panel", "PSNR eye",
          "SSIM eye", "traced: PSNR panel", "PSNR eye", "SSIM eye")
OTHERS = (measure.EVERY_VIEW, measure.SUBPIXEL, measure.USUAL)


@dataclasses.dataclass(frozen=True)
class Row:
    scene: str
    kind: str
    panel_pixels: tuple[int, int]
    points: tuple[measure.Point, ...]

    @property
    def references(self) -> tuple[str, ...]:
        """What its points are judged by, of WOVEN and TRACED."""
        return (WOVEN, TRACED) if all(point.traced for point in self.points) else (WOVEN,)


@dataclasses.dataclass(frozen=True)
class Comparison:
    width: int | None  # pixels of cut-down panels, None for the real ones
    reference_spp: int
    environment: Environment
    rows: tuple[Row, ...]


def markdown(comparison: Comparison) -> str:
    rows = []
    for row in comparison.rows:
        for point in row.points:
            seconds = (number(value, digits=1) for value in (point.render_cpu, point.finish_cpu, point.cpu))
            rows.append((row.scene, row.kind, point.way, point.samples, point.scale, *seconds,
                         *_figures(point.accuracy), *_figures(point.traced)))
    lines = [f"{comparison.environment.machine}; {comparison.environment.packages}.", "",
             *(f"- {way.name}: {way.meaning}." for way in measure.WAYS), "",
             *markdown_table(("scene", "display", "reference", "against", "at samples", "its SSIM eye", "its CPU s",
                              "ours CPU s", "times"), _verdicts(comparison), "llll"), "",
             *markdown_table(HEADER, rows, "lll")]
    return "\n".join(lines) + "\n"


def judged(point: measure.Point, reference: str) -> measure.Accuracy:
    """How near it comes to a reference that its row has."""
    return point.traced if reference == TRACED and point.traced else point.accuracy


def seconds_for(points: Sequence[measure.Point], value: float, reference: str = WOVEN) -> float | None:
    """Return the CPU seconds at which a way's curve reaches an ``ssim_eye``; None where it never does.

    Between two points the logarithm of time is interpolated; points that are slower and no better do not count.
    """
    rising: list[tuple[float, float]] = []  # value, seconds
    for seconds, reached in sorted((point.cpu, judged(point, reference).ssim_eye) for point in points):
        if not rising or reached > rising[-1][0]:
            rising.append((reached, seconds))
    if not rising or value > rising[-1][0]:
        return None
    values, times = np.array(rising).T
    return math.exp(np.interp(value, values, np.log(times)))


def figure(comparison: Comparison, reference: str = WOVEN) -> Figure | None:
    """A panel per scene and display: what eyes see, by processor seconds; None where no display has that reference."""
    rows = [row for row in comparison.rows if reference in row.references]
    if not rows:
        return None
    made = {WOVEN: "every view", TRACED: "the panel's subpixels"}[reference]
    figure, grid = plots.panel_sheet(len(rows), len({row.kind for row in rows}),
                                     f"Up and left is better: split SSIM of what eyes see, against {made} traced with "
                                     f"{comparison.reference_spp} samples; processor seconds on all cores, of one run")
    for axes, row in zip(grid, rows, strict=True):
        _panel(axes, row, reference)
    return figure


def _of(row: Row, way: measure.Way) -> tuple[measure.Point, ...]:
    return tuple(point for point in row.points if point.way == way.name)


def _figures(close: measure.Accuracy | None) -> tuple[str, ...]:
    values = (close.psnr_panel, close.psnr_eye, close.ssim_eye) if close else (None,) * 3
    return tuple(number(value, digits=digits) for value, digits in zip(values, (2, 2, 4), strict=True))


def _verdicts(comparison: Comparison) -> Iterator[tuple]:
    """Yield what each point of the other ways costs us."""
    for row in comparison.rows:
        rivals = [point for way in OTHERS for point in _of(row, way)]
        for reference, rival in itertools.product(row.references, rivals):
            its = judged(rival, reference).ssim_eye
            ours = seconds_for(_of(row, measure.OURS), its, reference)
            yield (row.scene, row.kind, reference, rival.way, rival.samples, number(its, digits=4),
                   number(rival.cpu, digits=1), number(ours, digits=1), number(ours and rival.cpu / ours, digits=1))


def _panel(axes: Axes, row: Row, reference: str) -> None:
    curves = [plots.Curve(way.name, plots.COLORS[index], plots.MARKERS[index], [point.cpu for point in points],
                          [judged(point, reference).ssim_eye for point in points],
                          notes=[str(point.samples) for point in points], bold=way == measure.OURS)
              for index, way in enumerate((measure.OURS, *OTHERS)) if (points := _of(row, way))]
    seconds, values = ([value for curve in curves for value in getattr(curve, axis)] for axis in "xy")
    plots.time_axis(axes, min(seconds) / 1.3, max(seconds) * 1.3)
    plots.value_axis(axes, plots.height(min(values)) - 0.3, plots.height(max(values)) + 0.3)
    plots.draw_curves(axes, curves, f"{row.scene}, {row.kind} {row.panel_pixels[0]}×{row.panel_pixels[1]}")


STEM = "displays"
FIGURES = {WOVEN: ".svg", TRACED: "-traced.svg"}
VERSION = 2  # of how points are measured


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    add("--width", type=int, metavar="PIXELS", help="of cut-down panels, a multiple of 192; default: the real panels")
    add("--reference-spp", type=int, default=1024, metavar="N", help="default: %(default)s")


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the report and name its files."""
    for name in measure.FULL_WIDTH:
        measure.kind(name, arguments.width)
    store = Store(arguments.output, arguments.blender)
    comparison = compare(store, arguments.width, arguments.reference_spp, arguments.scenes)
    print("\n".join(map(str, write_pages(arguments.output, comparison))))


def compare(store: Store, width: int | None, reference_spp: int, scenes: Sequence[Path]) -> Comparison:
    """Measure every scene on every kind of display, its panel ``width`` pixels wide; each result is stored at once."""
    rows: list[Row] = []
    comparison = Comparison(width, reference_spp, environment(), ())
    for scene in scenes:
        for name in measure.FULL_WIDTH:
            shown = measure.kind(name, width)
            points = tuple(_points(measure.Renders(store, scene, shown, reference_spp)))
            rows.append(Row(scene.stem, name, shown.panel_pixels, points))
            comparison = Comparison(width, reference_spp, environment(), tuple(rows))
            write_record(store.folder / f"{STEM}.json", comparison)
    return comparison


def write_pages(folder: Path, comparison: Comparison) -> list[Path]:
    """Write what people read beside the results, and return the paths of all files."""
    figures = {end: figure(comparison, reference) for reference, end in FIGURES.items()}
    texts = {end: functools.partial(svg, drawn) for end, drawn in figures.items() if drawn}
    return write_report(folder, STEM, None, {".md": lambda: markdown(comparison)} | texts)


def _points(renders: measure.Renders) -> Iterator[measure.Point]:
    costs, records = renders.fill(), Records(renders.folder / "points", measure.Point)

    @functools.cache
    def targets() -> list[measure.Target]:
        return [measure.Target.of(folder) for folder in (renders.reference, renders.traced_reference) if folder]

    for way, samples in measure.measured_at(renders.display):
        rendered, cpu = renders.path(way, samples), costs[way.name, samples]
        cell = Cell(rendered.name if way != measure.USUAL else f"{measure.USUAL.name}-{samples}",
                    {"version": VERSION, "reference": renders.reference_spp, "render": cpu},
                    functools.partial(measure.measure, way, samples, rendered, cpu, targets))
        for point in measured([cell], records, renders.store):
            to_stderr(f"{renders.scene.stem}, {renders.display.name}, {way.name}, {samples} samples: "
                      f"{point.cpu:.2f} s, {point.accuracy.ssim_eye:.4f} (load {records.load or 0:.1f})")
            yield point
