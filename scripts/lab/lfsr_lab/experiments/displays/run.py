"""The whole comparison: scenes on displays, point by point, and what people read of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from lfsr_core.frames.frame import read_rendered
from lfsr_core.records import write_record
from lfsr_lab.experiments.cells import Cells
from lfsr_lab.experiments.displays import page
from lfsr_lab.experiments.displays.kinds import FULL_WIDTH, kind
from lfsr_lab.experiments.displays.measure import Point, Target, finish, seen
from lfsr_lab.experiments.displays.page import Comparison, Row
from lfsr_lab.experiments.displays.renders import Shelf
from lfsr_lab.experiments.displays.ways import USUAL, Way, measured_at
from lfsr_lab.experiments.engine.environment import environment, load_average
from lfsr_lab.experiments.engine.plots import svg
from lfsr_lab.experiments.engine.report import write_text

RESULTS, TABLE = "displays.json", "displays.md"
PICTURES = {page.WOVEN: "displays.svg", page.TRACED: "displays-traced.svg"}
VERSION = 2  # of how points are measured
Report = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Settings:
    """What is compared, and where everything of it lies."""

    folder: Path
    width: int | None  # pixels of cut-down panels, None for the real ones
    reference_spp: int
    blender: str | None = None


def compare(settings: Settings, scenes: Sequence[Path], report: Report) -> Comparison:
    """Measure every scene on every kind of display; what is in the folder is kept, results are written after each."""
    rows: list[Row] = []
    for scene in scenes:
        for name in FULL_WIDTH:
            shown = kind(name, settings.width)
            shelf = Shelf(settings.folder / scene.stem / shown.profile.name, scene, shown, settings.reference_spp,
                          settings.blender)
            points = tuple(_points(shelf, settings, report))
            rows.append(Row(scene.stem, name, shown.profile.panel_pixels, points))
            found = Comparison(settings.width, settings.reference_spp, environment(), tuple(rows))
            write_record(settings.folder / RESULTS, found)
    return found


def write_pages(folder: Path, found: Comparison) -> list[Path]:
    """Write what people read beside the results, and name it."""
    pictures = {name: page.picture(found, reference) for reference, name in PICTURES.items()}
    return [write_text(folder / TABLE, page.markdown(found)),
            *(write_text(folder / name, svg(picture)) for name, picture in pictures.items() if picture)]


def _points(shelf: Shelf, settings: Settings, report: Report) -> Iterator[Point]:
    costs, cells, targets = shelf.fill(), Cells(shelf.folder / "points", Point), None
    for way, samples in measured_at(shelf.kind.profile):
        rendered = shelf.path(way, samples)
        mark = {"version": VERSION, "reference": settings.reference_spp, "render": costs[way.name, samples].cpu}
        name = shelf.path(way, samples).name if way.name != USUAL else f"{USUAL}-{samples}"
        point = cells.read(name, mark)
        if point is None:
            targets = targets or _targets(shelf)
            point = _measured(way, samples, rendered, costs[way.name, samples].cpu, targets)
            cells.write(name, mark, point)
        report(f"{shelf.scene.stem}, {shelf.kind.name}, {way.name}, {samples} samples: {point.cpu:.2f} s, "
               f"{point.accuracy.ssim_eye:.4f} (load {load_average() or 0:.1f})")
        yield point


def _targets(shelf: Shelf) -> list[Target]:
    """The woven reference and, where there is one, the traced one."""
    straight = shelf.straight_reference
    return [Target.of(shelf.reference), *([Target.straight(straight)] if straight else [])]


def _measured(way: Way, samples: int, rendered: Path, render_cpu: float, targets: Sequence[Target]) -> Point:
    if way.name != USUAL:
        finish(rendered, way)  # loads libraries; of OIDN for each view that hardly counts
    panel, seconds = finish(rendered, way)
    pictures, frame = seen(panel, targets[0].profile), read_rendered(rendered)
    close, *straight = (target.accuracy(panel, pictures) for target in targets)
    return Point(way.name, samples, render_cpu, seconds, close, frame.scale, straight[0] if straight else None)
