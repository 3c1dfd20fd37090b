"""The whole chart: renders, cells, analysis, chart.json and what people read."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import Frame, read_frame
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.records import write_record
from lfsr_lab.experiments.chart import page, panels, renders, tables
from lfsr_lab.experiments.chart.analysis import METRICS, analyse
from lfsr_lab.experiments.chart.measure import Effort, KeptCell, Target, cell, fresh_seconds, method_cost
from lfsr_lab.experiments.chart.overall import Overall
from lfsr_lab.experiments.chart.records import (
    CEILING,
    DIRECT,
    FORMAT,
    LOW,
    Cell,
    Chart,
    MethodCost,
    Role,
    SceneRow,
    Spread,
    UsedReference,
    read_chart,
)
from lfsr_lab.experiments.chart.settings import Settings, render_folder
from lfsr_lab.experiments.environment import environment
from lfsr_lab.experiments.page import write_text

CHART = "chart"  # stem of the files' names
MOST_STEM = 60  # characters of it
PAGES = {".html": page.page, ".svg": panels.picture, ".md": tables.markdown}


def measure(settings: Settings, scenes: Sequence[Path], overall: Overall) -> tuple[Chart, str]:
    """Measure ``scenes``, as far as they are not; what is known is written as JSON after every one.

    Other scenes that were measured with the same settings in this folder stay in the chart. ``overall`` is told of
    every step. LfsrError where not one scene can be measured.

    Returns
    -------
    The chart, and the stem of its files' names: another than "chart" where that chart has other scenes and settings
    """
    _check_names(scenes)
    names = [scene.stem for scene in scenes]
    kept, stem = _before(settings, names)
    run, costs = _Run(settings, overall, stem), ()
    rows = {row.scene: None if row.scene in names else row for row in kept}  # each stays in its place
    for scene in scenes:
        row = rows[scene.stem] = run.scene(scene)
        if row is not None:
            costs = costs or tuple(run.costs(scene, row))
            run.write(rows.values(), costs)
    if not any(rows[name] for name in names):
        raise LfsrError(f"no scene could be measured ({'; '.join(run.skipped)}): run it without --only-measure")
    return run.write(rows.values(), costs), stem


def _before(settings: Settings, names: Sequence[str]) -> tuple[tuple[SceneRow, ...], str]:
    """Scenes of an earlier run with the same settings, and the stem of this run's files."""
    path = settings.folder / f"{CHART}.json"
    try:
        before = read_chart(path) if path.exists() else None
    except LfsrError:  # of another version
        before = None
    if before is None or {scene.scene for scene in before.scenes} <= set(names):
        return (), CHART
    if before.settings == settings.figures:
        return before.scenes, CHART
    return (), f"{CHART}-{'-'.join(names)}"[:MOST_STEM]


def write_pages(folder: Path, chart: Chart, stem: str = CHART) -> list[Path]:
    """Write what people read beside the JSON file, and name all of it."""
    return [folder / f"{stem}.json", *(write_text(folder / f"{stem}{suffix}", make(chart))
                                       for suffix, make in PAGES.items())]


def _check_names(scenes: Sequence[Path]) -> None:
    names = [scene.stem for scene in scenes]
    for name in names:
        if names.count(name) > 1:
            raise LfsrError(f"two scenes are called {name!r}, but each has a folder of its name: rename one file")


@dataclasses.dataclass
class _Run:
    """One run: its settings, who follows it, the stem of its files, and sentences on what it had to leave out."""

    settings: Settings
    overall: Overall
    stem: str
    skipped: list[str] = dataclasses.field(default_factory=list)

    def write(self, rows: Iterable[SceneRow | None], costs: tuple[MethodCost, ...]) -> Chart:
        """Write the chart as far as it is known; only now is it known whether PyTorch was needed."""
        known = tuple(row for row in rows if row is not None)
        chart = Chart(FORMAT, self.settings.figures, environment(), costs, tuple(self.skipped), known)
        write_record(self.settings.folder / f"{self.stem}.json", chart)
        return chart

    def scene(self, path: Path) -> SceneRow | None:
        """Row of one scene; None if its reference is missing and may not be made, or no method finishes a render."""
        settings, folder = self.settings, renders.reference(self.settings, path, self.overall)
        if folder is None:
            return self._skip(f"{path.stem} has no reference")
        made = list(self._renders(path))
        mask = renders.widest_mask(settings.folder / path.stem, settings.scale, settings.profile.lenses)
        target = Target.read(folder, mask)
        cells = tuple(found for role, render in made for found in self._cells(path, role, render, target))
        if not cells:
            return self._skip(f"{path.stem} has no render that a method could finish")
        frame = target.reference.frame
        lenses = None if frame.lens_list is None else len(frame.lens_list)
        return SceneRow(path.stem, frame.blender, float(target.mask.mean()),
                        UsedReference(frame.samples, lenses, sum(frame.seconds.values())), cells,
                        tuple(analyse(cells, settings.ours, metric) for metric in METRICS))

    def costs(self, scene: Path, row: SceneRow) -> Iterator[MethodCost]:
        """What every method that was measured costs; its start is timed on the first scene's first render."""
        settings, measured = self.settings, {cell.method for cell in row.cells if cell.role != DIRECT}
        folder = render_folder(settings.folder / scene.stem, settings.scale, row.cells[0].samples, settings.seed)
        for name in settings.methods:
            if name in measured:
                self.overall.begin(name, f"{name} in a process of its own")
                again = name in settings.again or name in settings.retime
                seconds = fresh_seconds(folder, name, settings.folder, again)
                yield method_cost(name, settings.scale, settings.profile.low_views(settings.scale), seconds)

    def _renders(self, scene: Path) -> Iterator[tuple[Role, Path]]:
        """Role and frame folder of every render, the cheap ones first."""
        settings = self.settings
        wanted = [(LOW, settings.scale, samples) for samples in settings.spps]
        wanted += [(DIRECT, 1, samples) for samples in settings.direct_spps]
        wanted += [(CEILING, settings.scale, settings.ceiling_spp)] if settings.ceiling_spp else []
        for role, scale, samples in wanted:
            folder = render_folder(settings.folder / scene.stem, scale, samples, settings.seed)
            self.overall.begin(folder, f"{scene.stem}: scale {scale}, {samples} samples")
            folder = renders.low_render(settings, scene, scale, samples, self.overall)
            if folder is None:
                self._skip(f"{scene.stem} has no render at scale {scale} with {samples} samples")
            else:
                yield role, folder

    def _cells(self, scene: Path, role: Role, folder: Path, target: Target) -> Iterator[Cell]:
        """Every method on one render."""
        settings, frame = self.settings, read_frame(folder)
        # The ceiling's time is on no axis.
        seconds = [frame.seconds["render"]] if role == CEILING else renders.seconds_of(settings, scene, folder)
        for name in settings.direct_methods if role == DIRECT else settings.methods:
            parsed = MethodName.parse(name)
            missing = parsed.untrained(frame.scale)
            if not parsed.works_with(frame.display.parallax):
                self._skip(f"{name}: it needs views in two directions")
                continue
            if missing:
                self._skip(f"{name} at scale {frame.scale}: {', '.join(missing)} has no weights for it")
                continue
            self.overall.begin((folder, name), f"{scene.stem}: {name} at scale {frame.scale}, {frame.samples} samples")
            effort = Effort(settings.repeats, name in settings.again, name in settings.retime and role != CEILING)
            try:
                yield _cell(role, frame, tuple(seconds), cell(folder, name, target, effort))
            except LfsrError as error:
                self._skip(f"{name} at scale {frame.scale}: {error}")

    def _skip(self, sentence: str) -> None:
        if sentence not in self.skipped:
            self.skipped.append(sentence)
            self.overall.note(f"skipped: {sentence}")


def _cell(role: Role, frame: Frame, render_seconds: tuple[float, ...], kept: KeptCell) -> Cell:
    second = kept.times.second_stage_seconds
    median = statistics.median(statistics.median(render_seconds) + seconds for seconds in second)
    return Cell(role, kept.method, frame.scale, frame.samples, render_seconds, frame.seconds.get("open", 0.0),
                seconds=Spread(median, min(render_seconds) + min(second), max(render_seconds) + max(second)),
                metrics=kept.metrics, ci95=kept.ci95, device=frame.device, **dataclasses.asdict(kept.times))
