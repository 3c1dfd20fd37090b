"""The whole chart: renders, cells, analysis, chart.json and what people read."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import Frame, read_frame
from lfsr_core.frames.job import Job
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.records import write_record
from lfsr_lab.experiments.chart import page, panels, tables
from lfsr_lab.experiments.chart.analysis import METRICS, analyse
from lfsr_lab.experiments.chart.cells import (
    Effort,
    MeasuredCell,
    cell,
    fresh_seconds,
    low_job,
    method_cost,
    read_target,
    reference_job,
    wanted_renders,
)
from lfsr_lab.experiments.chart.overall import Overall
from lfsr_lab.experiments.chart.records import (
    CEILING,
    DIRECT,
    FORMAT,
    Cell,
    Chart,
    MethodCost,
    Role,
    SceneRow,
    Spread,
    UsedReference,
    read_chart,
)
from lfsr_lab.experiments.chart.settings import Settings
from lfsr_lab.experiments.engine.accuracy import Target
from lfsr_lab.experiments.engine.environment import environment
from lfsr_lab.experiments.engine.renders import Store, sampled
from lfsr_lab.experiments.engine.report import write_report
from lfsr_lab.experiments.engine.timing import render_seconds

CHART = "chart"  # stem of the files' names
MOST_STEM = 60  # characters of it


def measure(settings: Settings, scenes: Sequence[Path], overall: Overall) -> tuple[Chart, str]:
    """Measure ``scenes`` as far as they are not; what is known is written as JSON after every one.

    Other scenes that were measured with the same settings in this folder stay in the chart. ``overall`` is told of
    every step. LfsrError where not one scene can be measured.

    Returns
    -------
    The chart, and the stem of its files' names: another than "chart" where that chart has other scenes and settings
    """
    _check_names(scenes)
    names = [scene.stem for scene in scenes]
    before, stem = _before(settings, names)
    store = Store(settings.folder, settings.blender, not settings.only_measure, overall)
    run = _Run(settings, store, overall, stem)
    costs: tuple[MethodCost, ...] = ()
    # Each stays in its place.
    rows: dict[str, SceneRow | None] = {row.scene: None if row.scene in names else row for row in before}
    for scene in scenes:
        row = rows[scene.stem] = run.scene(scene)
        if row is not None:
            costs = costs or tuple(run.costs(scene, row))
            run.write(rows.values(), costs)
    if not any(rows[name] for name in names):
        raise LfsrError(f"no scene could be measured ({'; '.join(run.skipped)}): run it without --only-measure")
    return run.write(rows.values(), costs), stem


def write_pages(folder: Path, chart: Chart, stem: str = CHART) -> list[Path]:
    """Write what people read beside the JSON file, and return the paths of all files."""
    return write_report(folder, stem, None, {".html": page.page(chart), ".svg": panels.picture(chart),
                                             ".md": tables.markdown(chart)})


def _before(settings: Settings, names: Sequence[str]) -> tuple[tuple[SceneRow, ...], str]:
    """Return the scenes of an earlier run with the same settings, and the stem of this run's files."""
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


def _check_names(scenes: Sequence[Path]) -> None:
    names = [scene.stem for scene in scenes]
    for name in names:
        if names.count(name) > 1:
            raise LfsrError(f"two scenes are called {name!r}, but each has a folder of its name: rename one file")


@dataclasses.dataclass
class _Run:
    """One run: its settings, store and progress, the stem of its files, and sentences on what was left out."""

    settings: Settings
    store: Store
    overall: Overall
    stem: str
    skipped: list[str] = dataclasses.field(default_factory=list)

    def write(self, rows: Iterable[SceneRow | None], costs: tuple[MethodCost, ...]) -> Chart:
        """Write the chart as far as it is known; the environment knows only now whether PyTorch was needed."""
        known = tuple(row for row in rows if row is not None)
        chart = Chart(FORMAT, self.settings.figures, environment(), costs, tuple(self.skipped), known)
        write_record(self.settings.folder / f"{self.stem}.json", chart)
        return chart

    def scene(self, path: Path) -> SceneRow | None:
        """Return the row of one scene; None if its reference is missing, or if no method finishes a render."""
        if self._reference(path) is None:
            self._skip(f"{path.stem} has no reference")
            return None
        made = list(self._renders(path))
        target = read_target(self.settings, path)
        cells = tuple(found for role, folder in made for found in self._cells(path, role, folder, target))
        if not cells:
            self._skip(f"{path.stem} has no render that a method could finish")
            return None
        frame = target.reference.frame
        lenses = None if frame.lens_list is None else len(frame.lens_list)
        return SceneRow(path.stem, frame.blender, float(target.mask.mean()),
                        UsedReference(frame.samples, lenses, sum(frame.seconds.values())), cells,
                        tuple(analyse(cells, self.settings.ours, metric) for metric in METRICS))

    def costs(self, scene: Path, row: SceneRow) -> Iterator[MethodCost]:
        """Yield what every method that was measured costs; its start is timed on the first scene's first render."""
        settings, known = self.settings, {cell.method for cell in row.cells if cell.role != DIRECT}
        folder = Path(low_job(settings, scene, settings.scale, row.cells[0].samples).output)
        for name in settings.methods:
            if name in known:
                self.overall.begin(name, f"{name} in a process of its own")
                seconds = fresh_seconds(folder, name, self.store, name in (*settings.again, *settings.retime))
                yield method_cost(name, settings.scale, settings.profile.low_views(settings.scale), seconds)

    def _reference(self, scene: Path) -> Path | None:
        """Return the folder of the reference; one that is there may have any lenses and samples."""
        settings = self.settings
        most = low_job(settings, scene, settings.scale, max(settings.spps))
        job = sampled(reference_job(settings, scene), settings.lenses, lambda: self._render(scene, most))
        self.overall.begin(Path(job.output), f"{scene.stem}: reference of {job.spp} samples")
        return self.store.render(job)

    def _renders(self, scene: Path) -> Iterator[tuple[Role, Path]]:
        for role, job in wanted_renders(self.settings, scene):
            folder = self._render(scene, job)
            if folder is None:
                self._skip(f"{scene.stem} has no render at scale {job.scale} with {job.spp} samples")
            else:
                yield role, folder

    def _render(self, scene: Path, job: Job) -> Path | None:
        self.overall.begin(Path(job.output), f"{scene.stem}: scale {job.scale}, {job.spp} samples")
        return self.store.render(job)

    def _cells(self, scene: Path, role: Role, folder: Path, target: Target) -> Iterator[Cell]:
        """Yield the cells of every method on one render."""
        settings, frame = self.settings, read_frame(folder)
        job = low_job(settings, scene, frame.scale, frame.samples)
        # The ceiling's time is on no axis.
        seconds = [frame.seconds["render"]] if role == CEILING else render_seconds(
            job, self.store, settings.render_repeats, settings.retime_renders)
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


def _cell(role: Role, frame: Frame, render: tuple[float, ...], found: MeasuredCell) -> Cell:
    second = found.times.second_stage_seconds
    median = statistics.median(statistics.median(render) + seconds for seconds in second)
    return Cell(role, found.method, frame.scale, frame.samples, render, frame.seconds.get("open", 0.0),
                seconds=Spread(median, min(render) + min(second), max(render) + max(second)),
                metrics=found.accuracy.metrics, ci95=found.accuracy.ci95, device=frame.device,
                **dataclasses.asdict(found.times))
