"""The whole chart: renders, cells, analysis, chart.json and what people read."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import FRAME_FILE, read_frame
from lfsr_core.frames.identity import is_changed
from lfsr_core.frames.job import Job
from lfsr_core.progress import ProgressBar
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.records import write_record
from lfsr_core.render.content import scene_content
from lfsr_core.render.staging import staging_folder
from lfsr_lab.experiments.chart import cells, findings, panels
from lfsr_lab.experiments.chart.analysis import METRICS, analyse
from lfsr_lab.experiments.chart.records import (
    CEILING,
    DIRECT,
    FORMAT,
    Cell,
    Chart,
    MethodCost,
    Role,
    SceneRow,
    UsedReference,
    read_chart,
)
from lfsr_lab.experiments.chart.settings import Settings
from lfsr_lab.experiments.engine.accuracy import Target
from lfsr_lab.experiments.engine.environment import environment
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, reference_of, sampled
from lfsr_lab.experiments.engine.report import write_report
from lfsr_lab.experiments.engine.timing import render_seconds

CHART = "chart"  # stem of the files' names
REPEATS = {"repeats", "render_repeats"}  # settings that decide how often the same is measured


def run(settings: Settings, scenes: Sequence[Path]) -> list[Path]:
    """Measure ``scenes`` as far as they are not, write the chart, and return the paths of its files.

    What is known is written as JSON after every scene. Other scenes that were measured with the same settings in this
    folder stay in the chart. LfsrError where not one scene can be measured, where the folder holds a chart of other
    settings or renders of another scene, and where another process measures a chart in it.
    """
    names = [scene.stem for scene in scenes]
    for name in names:
        if names.count(name) > 1:
            raise LfsrError(f"two scenes are called {name!r}, but each has a folder of its name: rename one file")
    with staging_folder(settings.folder / CHART):
        for scene in scenes:
            _check_renders(settings.folder / scene.stem, scene)
        return _measured(settings, scenes, _earlier(settings, names) | dict.fromkeys(names))


def _measured(settings: Settings, scenes: Sequence[Path], rows: dict[str, SceneRow | None]) -> list[Path]:
    """Measure ``scenes``, whose rows are added to the known ``rows``, and write the chart; return its files' paths."""
    store = Store(settings.folder, settings.blender, not settings.only_measure)
    chart, measuring = None, _Run(settings, store, len(scenes) * settings.steps)
    for scene in scenes:
        rows[scene.stem] = measuring.scene(scene)
        if any(rows[scene.stem] for scene in scenes):
            chart = measuring.chart(rows.values())
            write_record(settings.folder / f"{CHART}.json", chart)
    if chart is None:
        raise LfsrError(f"no scene could be measured ({'; '.join(measuring.skipped)}): run it without --only-measure")
    measuring.bar.close()
    return write_report(settings.folder, CHART, None, {
        ".html": lambda: panels.page(chart), ".svg": lambda: panels.image(chart),
        ".md": lambda: findings.markdown(chart)})


def _earlier(settings: Settings, names: Sequence[str]) -> dict[str, SceneRow | None]:
    """Return the scenes of an earlier run with the same settings.

    LfsrError for a chart that may not be replaced; one that is only timed more often loses nothing where all of its
    scenes are among ``names``.
    """
    path = settings.folder / f"{CHART}.json"
    if not path.exists():
        return {}
    try:
        before = read_chart(path)
        changed = [name for name, value in vars(settings.figures).items() if vars(before.settings)[name] != value]
        if not changed:
            return {scene.scene: scene for scene in before.scenes}
        if not (set(changed) <= REPEATS and {scene.scene for scene in before.scenes} <= {*names}):
            raise LfsrError(f"{path} was measured with other settings ({', '.join(changed)})")
    except LfsrError as error:
        if settings.replace:
            return {}
        raise LfsrError(f"{error}: give another --output to keep it, or --replace to replace it") from None
    return {}


def _check_renders(folder: Path, scene: Path) -> None:
    """LfsrError if a render in the ``folder`` of a scene is one of another file, or from before it was changed."""
    content = scene_content(scene) if scene.is_file() else ""
    for path in sorted(folder.glob(f"*/{FRAME_FILE}")):
        found = read_frame(path.parent)
        if found.scene and found.scene != scene.name:
            raise LfsrError(f"{path.parent} was rendered of {found.scene}, but this chart is of {scene}: give another "
                            "--output")
        if is_changed(found.content, content):
            raise LfsrError(f"{path.parent} was rendered before {scene} was changed: give another --output")


@dataclasses.dataclass
class _Run:
    """One run of a chart, and what it found so far."""

    settings: Settings
    store: Store
    steps: int  # how many there are
    done: int = 0  # steps that are begun
    bar: ProgressBar = dataclasses.field(default_factory=ProgressBar)
    costs: tuple[MethodCost, ...] = ()
    skipped: list[str] = dataclasses.field(default_factory=list)  # sentences on what was left out

    def chart(self, rows: Iterable[SceneRow | None]) -> Chart:
        """Return the chart as far as it is known; the environment knows only now whether PyTorch was needed."""
        known = tuple(row for row in rows if row is not None)
        return Chart(FORMAT, self.settings.figures, environment(), self.costs, tuple(self.skipped), known)

    def scene(self, path: Path) -> SceneRow | None:
        """Return the row of one scene; None if its reference is missing, or if no method finishes a render."""
        if self._reference(path) is None:
            self._skip(f"{path.stem} has no reference")
            return None
        made = list(self._renders(path))
        target = cells.read_target(self.settings, path)
        found = tuple(cell for role, job in made for cell in self._cells(path, role, job, target))
        if not found:
            self._skip(f"{path.stem} has no render that a method could finish")
            return None
        self.costs = self.costs or tuple(self._costs(path, found))
        frame = target.reference.frame
        lenses = None if frame.lens_list is None else len(frame.lens_list)
        return SceneRow(path.stem, frame.blender, float(target.mask.mean()),
                        UsedReference(frame.samples, lenses, sum(frame.seconds.values())), found,
                        tuple(analyse(found, self.settings.ours, metric) for metric in METRICS))

    def _costs(self, scene: Path, found: Sequence[Cell]) -> Iterator[MethodCost]:
        """Yield what every method that was measured costs; its start is timed on the first render."""
        folder = Path(cells.low_job(self.settings, scene, self.settings.scale, found[0].samples).output)
        for name in self.settings.methods:
            if any(cell.method == name and cell.role != DIRECT for cell in found):
                try:
                    yield cells.method_cost(self.settings, name, folder)
                except LfsrError as error:
                    self._skip(f"{name}: its cost was not measured ({error})")

    def _reference(self, scene: Path) -> Path | None:
        """Return the folder of the reference, the same for any seed; what is there may have any lenses and samples."""
        settings = self.settings
        self._begin(f"{scene.stem}: reference")
        most = cells.low_job(settings, scene, settings.scale, max(settings.spps))
        whole = reference_of(most, settings.reference_spp, settings.folder / scene.stem / REFERENCE, seed=0)
        return self.store.render(sampled(whole, settings.lenses, lambda: self.store.render(most)))

    def _renders(self, scene: Path) -> Iterator[tuple[Role, Job]]:
        for role, job in cells.wanted_renders(self.settings, scene):
            self._begin(f"{scene.stem}: scale {job.scale}, {job.spp} samples")
            if self.store.render(job) is None:
                self._skip(f"{scene.stem} has no render at scale {job.scale} with {job.spp} samples")
            else:
                yield role, job

    def _cells(self, scene: Path, role: Role, job: Job, target: Target) -> Iterator[Cell]:
        """Yield the cells of every method on one render."""
        settings = self.settings
        # The ceiling's time is on no axis.
        repeats, retime = (1, False) if role == CEILING else (settings.render_repeats, settings.retime_renders)
        seconds = tuple(render_seconds(job, self.store, repeats, retime))
        for name in settings.direct_methods if role == DIRECT else settings.methods:
            self._begin(f"{scene.stem}: {name} at scale {job.scale}, {job.spp} samples")
            parsed = MethodName.parse(name)
            if not parsed.works_with(job.display.parallax):
                self._skip(f"{name}: it needs views in two directions")
                continue
            if parsed.network and job.scale not in parsed.network.weights:
                self._skip(f"{name} at scale {job.scale}: {parsed.upscaler} has no weights for it")
                continue
            try:
                yield cells.measured(Path(job.output), role, name, target, settings, seconds)
            except LfsrError as error:
                self._skip(f"{name} at scale {job.scale}: {error}")

    def _begin(self, step: str) -> None:
        self.bar(CHART, self.done / self.steps, step)
        self.done += 1

    def _skip(self, sentence: str) -> None:
        if sentence not in self.skipped:
            self.skipped.append(sentence)
            self.bar.note(f"skipped: {sentence}")
