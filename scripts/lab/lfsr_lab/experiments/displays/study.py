"""Three kinds of displays: this way of making their images against the usual one, time and accuracy.

The real panels take many hours on a CPU; --width 384 is of panels of 384×216 pixels with the same sheets.
What is complete in OUT is not done again. OUT/displays.json has everything, displays.md tables, displays.svg and
displays-traced.svg figures: against every view, and against the panel's subpixels where it has a lens sheet.
"""

from __future__ import annotations

import argparse
import functools
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfsr_core.base.records import write_record
from lfsr_lab.experiments.displays import page
from lfsr_lab.experiments.displays.kinds import FULL_WIDTH, kind
from lfsr_lab.experiments.displays.measure import USUAL, Point, Renders, Target, measure, measured_at
from lfsr_lab.experiments.displays.page import Comparison, Row
from lfsr_lab.experiments.engine.plots import svg
from lfsr_lab.experiments.engine.records import Cell, Records, measured, to_stderr
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import environment, write_report

STEM = "displays"
FIGURES = {page.WOVEN: ".svg", page.TRACED: "-traced.svg"}
VERSION = 2  # of how points are measured


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    add("--width", type=int, metavar="PIXELS", help="of cut-down panels, a multiple of 192; default: the real panels")
    add("--reference-spp", type=int, default=1024, metavar="N", help="default: %(default)s")


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the report and name its files."""
    for name in FULL_WIDTH:
        kind(name, arguments.width)
    store = Store(arguments.output, arguments.blender)
    found = compare(store, arguments.width, arguments.reference_spp, arguments.scenes)
    print("\n".join(map(str, write_pages(arguments.output, found))))


def compare(store: Store, width: int | None, reference_spp: int, scenes: Sequence[Path]) -> Comparison:
    """Measure every scene on every kind of display, its panel ``width`` pixels wide; each result is stored at once."""
    rows: list[Row] = []
    found = Comparison(width, reference_spp, environment(), ())
    for scene in scenes:
        for name in FULL_WIDTH:
            shown = kind(name, width)
            points = tuple(_points(Renders(store, scene, shown, reference_spp)))
            rows.append(Row(scene.stem, name, shown.panel_pixels, points))
            found = Comparison(width, reference_spp, environment(), tuple(rows))
            write_record(store.folder / f"{STEM}.json", found)
    return found


def write_pages(folder: Path, found: Comparison) -> list[Path]:
    """Write what people read beside the results, and return the paths of all files."""
    figures = {end: page.figure(found, reference) for reference, end in FIGURES.items()}
    texts = {end: functools.partial(svg, drawn) for end, drawn in figures.items() if drawn}
    return write_report(folder, STEM, None, {".md": lambda: page.markdown(found)} | texts)


def _points(renders: Renders) -> Iterator[Point]:
    costs, records = renders.fill(), Records(renders.folder / "points", Point)

    @functools.cache
    def targets() -> list[Target]:
        return [Target.of(folder) for folder in (renders.reference, renders.traced_reference) if folder]

    for way, samples in measured_at(renders.display):
        rendered, cpu = renders.path(way, samples), costs[way.name, samples]
        cell = Cell(rendered.name if way != USUAL else f"{USUAL.name}-{samples}",
                    {"version": VERSION, "reference": renders.reference_spp, "render": cpu},
                    functools.partial(measure, way, samples, rendered, cpu, targets))
        for point in measured([cell], records, renders.store):
            to_stderr(f"{renders.scene.stem}, {renders.display.name}, {way.name}, {samples} samples: "
                      f"{point.cpu:.2f} s, {point.accuracy.ssim_eye:.4f} (load {records.load or 0:.1f})")
            yield point
