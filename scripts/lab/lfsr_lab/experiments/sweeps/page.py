"""The report of the parameter sweeps: breaking points, figures, curves, and the worst crop of every method."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.images.png import write_png
from lfsr_core.images.srgb import srgb_encode
from lfsr_lab.experiments.engine.plots import COLORS, MARKERS, Curve, draw_curves, panel_sheet, svg
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import inline_svg, markdown_table, number, page_html
from lfsr_lab.experiments.sweeps.measure import BASELINE, Scene, finished
from lfsr_lab.experiments.sweeps.records import Cell, Repeat, Report, Settings, SweepReport, breaking_point
from lfsr_lab.experiments.sweeps.sweeps import Sweep, choose_sweeps, label

if TYPE_CHECKING:
    from markupsafe import Markup

STEM, PAGE_FILE, CROPS = "stress", "index.html", "pictures"
LENSES_IN_CROP, LEAST_CROP, GAP = 3, 240, 6
LEGEND = ("A number is the first value of the sweep where the method breaks: **b** below bicubic, **s** 0.05 below its "
          "own start; in brackets where else it may be with 95 % confidence over the seeds. – : it never breaks. ? : "
          "nothing could be measured.")


def report_of(sweep: Sweep, values: Sequence[float], cells: tuple[Cell, ...], methods: Sequence[str],
              others: Sequence[Cell] = ()) -> SweepReport:
    """Return what the cells of a sweep say; ``others`` are those of further seeds, in their order."""
    figures: dict[str, dict[float, list[float | None]]] = {method: {} for method in methods}
    for cell in (*cells, *others):
        figures[cell.method].setdefault(cell.value, []).append(cell.metrics.get(sweep.judged))
    breaks = {method: breaking_point(values, quality, figures[BASELINE]) for method, quality in figures.items()}
    repeats = [Repeat(value, method, tuple(known)) for method, quality in figures.items()
               for value, known in quality.items() if len(known) > 1]
    return SweepReport(sweep.name, sweep.meaning, sweep.unit, sweep.judged, tuple(values), cells, breaks,
                       tuple(repeats))


def markdown(report: Report) -> str:
    """Return the breaking points of every method, then the figures of every sweep."""
    breaks = [[sweep.name, sweep.span, *map(sweep.break_text, report.methods)] for sweep in report.sweeps]
    lines = ["# Parameter sweeps", "", str(report.settings), "", "## Breaking points", "", LEGEND, "",
             *markdown_table(["sweep", "from – to", *report.methods], breaks)]
    for sweep in report.sweeps:
        lines += ["", f"## {sweep.name}", "", f"{sweep.meaning.capitalize()}; values are {sweep.unit}.", ""]
        for metric in sweep.shown:
            columns = {method: sweep.series(method, metric) for method in report.methods}
            if metric == sweep.judged:  # the reference's own noise is of the same kind
                columns["ssim_ceiling"] = sweep.series(BASELINE, "ssim_ceiling")
            rows = zip(map(label, sweep.values), *columns.values(), strict=True)
            lines += [*markdown_table([metric, *columns], rows), ""]
    return "\n".join(lines).rstrip() + "\n"


def html(store: Store, report: Report) -> str:
    """Return the page; its crops are written into the folder."""
    crops = {sweep.name: [crop for method in report.methods
                          if (crop := _write_crop(store, report.settings, sweep, method))] for sweep in report.sweeps}
    return page_html("sweeps.html", report=report, legend=LEGEND.split("**"), crops=crops,
                     curves={sweep.name: curves(sweep, report.methods) for sweep in report.sweeps},
                     label=label, number=number)


def shown_cell(sweep: SweepReport, method: str) -> Cell | None:
    """Return the cell whose crop is shown: where the method breaks, else where its judged figure is lowest."""
    cells = [cell for cell in sweep.cells if cell.method == method and cell.worst_lens is not None]
    found = sweep.breaks[method]
    if found is not None:
        return next((cell for cell in cells if cell.value == found.value), None)
    judged = [(figure, cell) for cell in cells if (figure := cell.metrics.get(sweep.judged)) is not None]
    return min(judged, key=lambda pair: pair[0], default=(None, None))[1]


def _write_crop(store: Store, settings: Settings, entry: SweepReport, method: str) -> tuple[str, Cell] | None:
    """Write the crops of reference, bicubic and method around a worst lens; return the file's name and its cell."""
    cell = shown_cell(entry, method)
    if cell is None or cell.worst_lens is None:
        return None
    scene = Scene(store, settings, choose_sweeps([entry.name])[0], cell.value)
    halves, render = scene.truth.whole, Path(scene.job().output)
    names = tuple(dict.fromkeys((BASELINE, method)))
    images = [(halves[0] + halves[1]) / 2, *(finished(render, name) for name in names)]
    crops = [crop_around(srgb_encode(image), settings.display.lenses, cell.worst_lens) for image in images]
    source = f"{CROPS}/{entry.name}-{method.replace('+', '-')}.png"
    write_png(store.folder / source, side_by_side(crops))
    return source, cell


def crop_around(image: Array, lenses: tuple[int, int], lens: tuple[int, int], across: int = LENSES_IN_CROP) -> Array:
    """Return the elemental images of an EIA (H, W, 3) around ``lens`` (row, column), near the edges beside it.

    ``across``: lenses along the axis where they have most pixels; along the other as many as make the crop square.
    """
    size = image.shape[0] // lenses[1], image.shape[1] // lenses[0]
    spans = []
    for at, count, pixels in zip(lens, lenses[::-1], size, strict=True):
        reach = min(across * max(size) // pixels, count)
        first = min(max(at - reach // 2, 0), count - reach)
        spans.append(slice(first * pixels, (first + reach) * pixels))
    return image[tuple(spans)]


def side_by_side(crops: Sequence[Array]) -> Array:
    """Return crops of sRGB values in [0, 1], enlarged to LEAST_CROP rows, in a row with white gaps, 8 bits."""
    times = max(1, -(-LEAST_CROP // crops[0].shape[0]))
    large = [np.rint(np.clip(crop, 0, 1) * 255).astype(np.uint8).repeat(times, 0).repeat(times, 1) for crop in crops]
    gap = np.full((large[0].shape[0], GAP, 3), 255, np.uint8)
    return np.concatenate([part for crop in large for part in (gap, crop)][1:], axis=1)


def curves(sweep: SweepReport, methods: Sequence[str]) -> Markup | None:
    """Draw the judged figure along the sweep, one step of it per step across; None where nothing could be measured."""
    drawn = []
    figure, (axes,) = panel_sheet(1)
    axes.set_xticks(range(len(sweep.values)), map(label, sweep.values))
    for index, method in enumerate(methods):
        known = [(place, value) for place, value in enumerate(sweep.series(method, sweep.judged)) if value is not None]
        if known:
            color, marker = COLORS[index % len(COLORS)], MARKERS[index // len(COLORS) % len(MARKERS)]
            x, y = zip(*known, strict=True)
            drawn.append(Curve(method, color, marker, x, y))
            if found := sweep.breaks[method]:
                axes.plot(sweep.values.index(found.value), found.quality, "o", ms=13, mfc="none", mec=color)
    if not drawn:
        return None
    draw_curves(axes, drawn, sweep.judged)
    return inline_svg(svg(figure), f"{sweep.judged} along {sweep.name}")
