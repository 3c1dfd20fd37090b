"""The stability suite as a page: breaking points, curves, and the worst crop of every method."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.reference import Reference
from lfsr_core.images.png import write_png
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_lab.experiments.engine.plots import COLORS, sheet, svg
from lfsr_lab.experiments.engine.report import inline_svg, number, write_page
from lfsr_lab.experiments.stress.dials import choose_dials, label
from lfsr_lab.experiments.stress.folder import BASELINE, Bench
from lfsr_lab.experiments.stress.records import Cell, DialReport, Report
from lfsr_lab.experiments.stress.report import LEGEND

if TYPE_CHECKING:
    from markupsafe import Markup

PAGE_FILE, PICTURES = "index.html", "pictures"
LENSES_IN_CROP, LEAST_CROP, GAP = 3, 240, 6
DASHES = ("solid", "dashed", "dotted")  # after each round of colours
WIDTH, HEIGHT = 6.4, 3.0  # of a drawing of curves, in inches


@dataclasses.dataclass(frozen=True)
class Picture:
    """The worst crop of one method along one dial."""

    source: str  # path of the file, as seen from the page
    method: str  # its name
    cell: Cell  # whose worst lens it shows

    @property
    def order(self) -> tuple[str, ...]:
        """What the picture shows, from left to right."""
        return tuple(dict.fromkeys(("reference", BASELINE, self.method)))


def write_stress_page(bench: Bench, report: Report) -> Path:
    """Write index.html and its pictures into the bench folder; path of the page."""
    pictures = {dial.name: [picture for method in report.methods if (picture := _write_crop(bench, dial, method))]
                for dial in report.dials}
    return write_page(bench.folder / PAGE_FILE, "stress.html", report=report, legend=LEGEND.split("**"),
                      pictures=pictures, curves={dial.name: curves(dial, report.methods) for dial in report.dials},
                      strokes=list(zip(report.methods, map(stroke, range(len(report.methods))), strict=True)),
                      label=label, number=number)


def shown_cell(dial: DialReport, method: str) -> Cell | None:
    """The cell whose crop is shown: where the method breaks, else where its judged figure is lowest."""
    cells = [cell for cell in dial.cells if cell.method == method and cell.worst_lens is not None]
    found = dial.breaks[method]
    if found is not None:
        return next((cell for cell in cells if cell.value == found.value), None)
    judged = [cell for cell in cells if cell.metrics.get(dial.judged) is not None]
    return min(judged, key=lambda cell: cell.metrics[dial.judged], default=None)


def _write_crop(bench: Bench, entry: DialReport, method: str) -> Picture | None:
    """Picture of reference, bicubic and method around the worst lens."""
    cell = shown_cell(entry, method)
    if cell is None:
        return None
    dial = choose_dials([entry.name])[0]
    reference = Reference.read(bench.reference(dial, cell.value))
    render = bench.render(dial, cell.value)
    images = [(reference.half_a + reference.half_b) / 2,
              *(finished_linear(render, name) for name in dict.fromkeys((BASELINE, method)))]
    lenses = bench.settings.display.lenses
    crops = [enlarged(crop_around(srgb_encode(image), lenses, cell.worst_lens)) for image in images]
    source = f"{PICTURES}/{dial.name}-{method.replace('+', '-')}.png"
    write_png(bench.folder / source, side_by_side(crops))
    return Picture(source, method, cell)


def crop_around(image: Array, lenses: tuple[int, int], lens: tuple[int, int],
                across: int = LENSES_IN_CROP) -> Array:
    """The elemental images around a lens.

    Parameters
    ----------
    image: EIA (H, W, 3).
    lenses: (sx, sy) of the EIA.
    lens: (row, column), in the middle of the crop where the image reaches so far.
    across: lenses of the crop along the axis where they have most pixels; along the other as many as make it square.
    """
    size = image.shape[0] // lenses[1], image.shape[1] // lenses[0]
    spans = []
    for at, count, pixels in zip(lens, lenses[::-1], size, strict=True):
        reach = min(across * max(size) // pixels, count)
        first = min(max(at - reach // 2, 0), count - reach)
        spans.append(slice(first * pixels, (first + reach) * pixels))
    return image[tuple(spans)]


def enlarged(crop: Array) -> Array:
    """8-bit crop of sRGB values in [0, 1], pixels repeated until it is LEAST_CROP high."""
    times = max(1, -(-LEAST_CROP // crop.shape[0]))
    return np.rint(np.clip(crop, 0, 1) * 255).astype(np.uint8).repeat(times, axis=0).repeat(times, axis=1)


def side_by_side(crops: Sequence[Array]) -> Array:
    """Crops of equal height in a row with white gaps."""
    gap = np.full((crops[0].shape[0], GAP, 3), 255, np.uint8)
    parts = [part for crop in crops for part in (gap, crop)]
    return np.concatenate(parts[1:], axis=1)


def stroke(index: int) -> tuple[str, str]:
    """Colour and dashes of the curve of method number ``index``."""
    return COLORS[index % len(COLORS)], DASHES[index // len(COLORS) % len(DASHES)]


def curves(dial: DialReport, methods: Sequence[str]) -> Markup | None:
    """Judged figure along the dial, one step of the dial per step across; None where nothing could be measured."""
    lines = {method: dial.series(method, dial.judged) for method in methods}
    if all(value is None for line in lines.values() for value in line):
        return None
    figure, grid = sheet(WIDTH, HEIGHT)
    axis = grid[0, 0]
    for index, (method, line) in enumerate(lines.items()):
        color, dashes = stroke(index)
        known = [(place, value) for place, value in enumerate(line) if value is not None]
        axis.plot(*zip(*known, strict=True), color=color, linestyle=dashes, marker="o", ms=3, lw=1.4, gid=method)
        found = dial.breaks[method]
        if found is not None:
            place = dial.values.index(found.value)
            axis.plot(place, line[place], "o", ms=9, mfc="none", mec=color, gid=f"{method}, breaks")
    axis.set_xticks(range(len(dial.values)), map(label, dial.values))
    axis.set_ylabel(dial.judged)
    axis.grid(axis="y", color="#ddd")
    return inline_svg(svg(figure), f"{dial.judged} along {dial.name}")
