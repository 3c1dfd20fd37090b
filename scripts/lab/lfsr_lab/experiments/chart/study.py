"""Speed and accuracy of every method on scenes, measured end to end, and drawn.

What OUT lacks is rendered, every render is finished by every method; docs/reference/chart.md explains it.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from lfsr_core.base.messages import LfsrError, Progress
from lfsr_core.base.records import write_record
from lfsr_core.base.system import staging_folder
from lfsr_core.commands.common import ProgressBar, names, numbers
from lfsr_core.frames.folder import FrameFolder, is_changed, scene_stamp
from lfsr_core.frames.frame import FRAME_FILE, check_scene, read_frame
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_lab.experiments.chart import analysis, cells, findings, panels
from lfsr_lab.experiments.chart.cells import DIRECT_METHODS, Settings, default_methods
from lfsr_lab.experiments.engine.records import REFERENCE, Store, check_render, reference_of, sampled
from lfsr_lab.experiments.engine.report import environment, write_report
from lfsr_lab.experiments.engine.seeds import blocks_of
from lfsr_lab.experiments.engine.truth import Truth, reference_noise
from lfsr_lab.networks.methods import LabMethod

CHART = "chart"  # stem of the files' names
REFERENCE_SEED = 1000  # other noise than that of any render


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("scenes", nargs="+", type=Path, metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    add("--display", default="small", metavar="NAME|FILE.toml", help="default: %(default)s")
    add("--methods", type=names, metavar="NAME,NAME", help="default: every method there is")
    add("--ours", metavar="NAME", help="method that is held against the others; default: the default")
    add("--scale", type=int, default=4, metavar="2|3|4|5|8", help="default: %(default)s")
    add("--spps", type=_numbers, default=(1, 4, 16, 64), metavar="N,N",
        help="samples per pixel of low-resolution renders, default: 1,4,16,64")
    add("--direct-spps", type=_numbers, default=(1, 4, 16), metavar="N,N",
        help="samples of direct high-resolution renders, default: 1,4,16; `none` for none")
    add("--reference-spp", type=int, default=1024, metavar="N", help="default: %(default)s")
    add("--lenses", type=int, metavar="N", help="sampled reference of N lenses; default: all")
    add("--seeds", type=int, default=10, metavar="N", help="renders of each, whose noise differs, default: %(default)s")
    add("--subject", metavar="COLLECTION", help="the foreground; default: everything but the world and a collection "
                                                "called Background")
    add("--world-visible", action=argparse.BooleanOptionalAction,
        help="show the world behind the subject; default: what each scene says")
    add("--device", default="CPU", metavar="NAME", help="Cycles device, default: %(default)s")
    add("--repeats", type=int, default=3, metavar="N", help="timed runs of the second stage, default: %(default)s")
    add("--times", action="store_true", help="time what is not timed; without it nothing is timed")
    add("--only-measure", action="store_true", help="render nothing; leave out what is not there")


def _numbers(text: str) -> tuple[int, ...]:
    return () if text == "none" else numbers(text)


def run(arguments: argparse.Namespace) -> None:
    """Measure scenes as far as they are not, write the chart, and print the paths of its files.

    What is known is written as JSON after every scene. LfsrError where not one scene can be measured, where the folder
    holds renders of another scene, and where another process measures a chart in it.
    """
    ours, scenes = arguments.ours or DEFAULT_METHOD, arguments.scenes
    methods = tuple(dict.fromkeys([ours, *(arguments.methods or default_methods())]))
    for name in methods:
        LabMethod.parse(name)
    settings = Settings(**Settings.given(arguments) | {"methods": methods, "direct_methods": DIRECT_METHODS,
                                                       "ours": ours})
    for scene in scenes:
        if not settings.only_measure:
            check_scene(scene)
        if sum(other.stem == scene.stem for other in scenes) > 1:
            raise LfsrError(f"two scenes are called {scene.stem!r}, but each has a folder of its name: rename one file")
    with staging_folder(settings.output / CHART):
        for scene in scenes:  # renders of another file, or from before it was changed, are refused
            content = scene_stamp(scene) if scene.is_file() else ""
            for path in sorted((settings.output / scene.stem).glob(f"*/{FRAME_FILE}")):
                frame = read_frame(path.parent)
                if frame.scene and frame.scene != scene.name:
                    raise LfsrError(f"{path.parent} was rendered of {frame.scene}, but this chart is of {scene}: give "
                                    "another --output")
                if is_changed(frame.content, content):
                    raise LfsrError(f"{path.parent} was rendered before {scene} was changed: give another --output")
        measuring = _Run(settings, Store(settings.output, settings.blender, not settings.only_measure),
                         len(scenes) * settings.steps)
        for scene in scenes:
            measuring.scene(scene)
            if measuring.rows:
                write_record(settings.output / f"{CHART}.json", measuring.chart())
        if not measuring.rows:
            raise LfsrError(f"no scene could be measured ({'; '.join(measuring.skipped)}): run it without "
                            "--only-measure")
        measuring.bar.close()
        chart = measuring.chart()
        shown = [scene for scene in scenes if scene.stem in measuring.rows]
        for path in write_report(settings.output, CHART, None, {
                ".html": lambda: panels.page(chart, panels.chosen_crops(chart, settings, shown)),
                ".svg": lambda: panels.image(chart), ".md": lambda: findings.markdown(chart)}):
            print(path)


@dataclasses.dataclass
class _Run:
    settings: Settings
    store: Store
    steps: int  # how many there are
    done: int = 0  # steps that are begun
    bar: ProgressBar = dataclasses.field(default_factory=ProgressBar)
    rows: dict[str, analysis.SceneRow] = dataclasses.field(default_factory=dict)
    skipped: list[str] = dataclasses.field(default_factory=list)  # sentences on what was left out

    def chart(self) -> analysis.Chart:
        """Return the chart as far as it is known; the environment knows only now whether PyTorch was needed."""
        return analysis.Chart(analysis.FORMAT, self.settings.figures, environment(), tuple(self.skipped),
                              tuple(self.rows.values()))

    def scene(self, path: Path) -> None:
        """Measure a scene, unless its reference is missing or shows no foreground, or no method finishes a render."""
        settings = self.settings
        self._begin(f"{path.stem}: reference")
        most = cells.job(settings, path, settings.scale, max(settings.spps))
        whole = reference_of(most, settings.reference_spp, settings.output / path.stem / REFERENCE, seed=REFERENCE_SEED)
        folder = self.store.render(sampled(whole, settings.lenses, lambda: self.store.render(most)))
        if folder is None:
            return self._skip(f"{path.stem} has no reference")
        truth = Truth(folder)
        if not truth.counted.any():
            return self._skip(f"{path.stem} has no foreground in the lenses of its reference")
        blocks = blocks_of(truth.lenses)
        points = []
        for render in cells.renders(settings, path):
            job = render.jobs[0]
            scale, samples = job.sampling.scale, job.sampling.samples
            self._begin(f"{path.stem}: scale {scale}, {samples} samples")
            if self.store.may_render:
                self.store.render_all(render.jobs)
            if not all(FrameFolder(folder).holds() for folder in render.folders):
                self._skip(f"{path.stem} has no render at scale {scale} with {samples} samples and {len(render.jobs)} "
                           "seeds")
                continue
            for seed in render.jobs:
                check_render(seed)
            for name in settings.direct_methods if render.role == analysis.DIRECT else settings.methods:
                self._begin(f"{path.stem}: {name} at scale {scale}, {samples} samples")
                parsed = LabMethod.parse(name)
                if not parsed.works_with(job.display.parallax):
                    self._skip(f"{name}: it needs views in two directions")
                elif parsed.network and not parsed.works_at(scale):
                    self._skip(f"{name} at scale {scale}: {parsed.network} has no weights for it")
                else:
                    points.append(analysis.Point.of(
                        render.role, name, scale, samples, cells.measured(render, name, truth),
                        cells.times(settings, render, name), blocks))
        if not points:
            return self._skip(f"{path.stem} has no render that a method could finish")
        frame = truth.reference.frame
        noise = {name: analysis.short(value) for name, value in reference_noise(*truth.halves).items()}
        lenses = None if frame.lens_list is None else len(frame.lens_list)
        used = analysis.UsedReference(frame.samples, lenses, int(truth.counted.sum()), sum(frame.seconds.values()),
                                      noise)
        duels = analysis.duels(points, (analysis.LOW, settings.ours))
        self.rows[path.stem] = analysis.SceneRow(
            path.stem, truth.reference.frame.blender, used, tuple(point.cell for point in points), tuple(duels),
            tuple(analysis.reaches(points, analysis.FIXED)))

    def _begin(self, step: str) -> None:
        self.bar(Progress(CHART, self.done / self.steps, step))
        self.done += 1

    def _skip(self, sentence: str) -> None:
        if sentence not in self.skipped:
            self.skipped.append(sentence)
            self.bar.note(f"skipped: {sentence}")
