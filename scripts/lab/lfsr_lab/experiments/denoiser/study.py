"""Judge denoisers on known and unprepared scenes, against references of a few lenses.

SCENES are folders in which the files of denoiser.toml are looked for; scenes that are in none of them are left out.
What is complete in OUT is not done again. Without --only-measure missing renders are made, some minutes a scene.
BASELINES are measured too. OUT/denoiser.md has the tables, denoiser.json the means.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import Finish, Frame, Request, Sampling, check_scene, read_frame
from lfsr_core.images.color import srgb_encode
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, MethodName
from lfsr_lab.experiments.displays.measure import FULL_WIDTH, kind
from lfsr_lab.experiments.engine.records import (
    REFERENCE,
    Fingerprint,
    Records,
    Store,
    StudySettings,
    digest,
    foreground,
    frame_digest,
    method_facts,
    reference_of,
    sampled,
)
from lfsr_lab.experiments.engine.report import Environment, environment, markdown_table, number, write_report
from lfsr_lab.experiments.engine.timing import cpu_seconds
from lfsr_lab.experiments.engine.truth import FLIP, RELMSE, SSIM, VERSION, Figures, Truth, errors

METRICS = {"ssim": "`ssim_lens_fg`", "flip": "HDR-FLIP", "relative": "relMSE"}


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A method, with a file of weights where it is to have others than the shipped ones."""

    name: MethodName
    weights: Path | None = None

    @classmethod
    def parse(cls, text: str) -> Candidate:
        """Parse METHOD or METHOD=WEIGHTS."""
        name, _, weights = text.partition("=")
        return cls(MethodName.parse(name), Path(weights).resolve() if weights else None)

    @property
    def label(self) -> str:
        return self.name.text + (f"={self.weights.parent.name}-{self.weights.stem}" if self.weights else "")

    def at(self, frame: Frame) -> Candidate | None:
        """Return it as it finishes a frame; None where it cannot."""
        if frame.scale == 1:
            return dataclasses.replace(self, name=self.name.at_scale(1))
        return self if self.name.works_at(frame.scale) else None

    def facts(self, render: Path, reference: Path) -> Fingerprint:
        weights = {"file": digest(self.weights.read_bytes())} if self.weights else {}
        return {"version": VERSION, "render": frame_digest(render), "reference": frame_digest(reference),
                "method": self.name.text, **method_facts(self.name.text), **weights}


def measure(render: Path, truth: Truth, candidate: Candidate) -> Figures:
    """Finish the reference's lenses and compare them with it."""
    finish = Finish(candidate.name.text, weights=str(candidate.weights) if candidate.weights else None)
    started = cpu_seconds()
    images = truth.finished(render, finish)
    return figures(truth, images, cpu_seconds() - started)


def figures(truth: Truth, images: Array, seconds: float) -> Figures:
    """Return the figures of scene-linear images as ``Truth.shown``."""
    lens_errors = errors(images[None], *truth.halves)
    x, a, b = (srgb_encode(values) for values in (images, *truth.halves))
    return Figures(_values(1 - lens_errors[SSIM][0]), _values(((x - a) * (x - b)).mean((1, 2, 3), dtype=np.float64)),
                   round(seconds, 3), _values(lens_errors[FLIP][0]), _values(lens_errors[RELMSE][0]))


def _values(values: Any) -> tuple[float, ...]:
    return tuple(float(f"{value:.6g}") for value in values)


SETTINGS = Path(__file__).parent / "denoiser.toml"
REFERENCE_SEED = 1000  # other noise than that of any render
BASE_SAMPLES = 16  # of the render whose foreground decides which lenses the reference shows
BLOCK = 24  # lenses along each side that a reference shows where views differ along one axis


@dataclasses.dataclass(frozen=True)
class Scene:
    name: str
    file: str  # below one of the folders of scenes
    group: str  # over which figures are averaged
    seeds: int = 2  # renders of each of ``Settings.repeated``
    display: str = "small"  # its name, or "lenticular-384": a kind of the displays' study and its width
    scale: int = 4  # of the renders that are compared between methods
    lenses: int = 22  # that a reference shows

    @property
    def profile(self) -> DisplayProfile:
        name, _, width = self.display.rpartition("-")
        return kind(name, int(width)) if name in FULL_WIDTH else load_display(self.display)


@dataclasses.dataclass(frozen=True, order=True)
class Render:
    scale: int
    samples: int
    seed: int = 0

    @property
    def folder(self) -> str:
        return f"s{self.scale}-spp{self.samples}-seed{self.seed}"


@dataclasses.dataclass(frozen=True)
class Settings(StudySettings):
    """What is rendered."""

    scenes: tuple[Scene, ...]
    reference_samples: int  # in both halves together
    repeated: tuple[int, ...]  # samples that are rendered with several seeds
    once: tuple[int, ...]  # samples that are rendered with one
    rays: dict[str, dict[str, int]]  # samples by scale, for each number of rays per finished pixel

    def at_scale(self, scene: Scene) -> list[Render]:
        """Return the renders at the scene's scale, by which methods are compared."""
        seeds = {samples: scene.seeds for samples in self.repeated} | dict.fromkeys(self.once, 1)
        return [Render(scene.scale, samples, seed) for samples in sorted(seeds) for seed in range(seeds[samples])]

    def at_rays(self, scene: Scene) -> dict[str, list[Render]]:
        """Return the renders with equal rays at every scale that the display has."""
        possible = {1, *scene.profile.scales()}
        return {rays: [Render(int(scale), samples) for scale, samples in samples_at.items() if int(scale) in possible]
                for rays, samples_at in self.rays.items()}

    def renders(self, scene: Scene) -> list[Render]:
        return list(dict.fromkeys(itertools.chain(self.at_scale(scene), *self.at_rays(scene).values())))


@dataclasses.dataclass(frozen=True)
class Place:
    store: Store
    scene: Scene
    file: Path

    @property
    def folder(self) -> Path:
        return self.store.folder / self.scene.name

    def job(self, render: Render) -> Request:
        return Request(str(self.folder / render.folder), self.scene.profile, check_scene(self.file),
                       sampling=Sampling(render.scale, render.samples), seed=render.seed)

    def reference(self, samples: int) -> Request:
        """Return the job of the reference; what decides its lenses is rendered now."""
        base = self.job(Render(self.scene.scale, BASE_SAMPLES))
        whole = reference_of(base, samples, self.folder / REFERENCE, seed=REFERENCE_SEED)
        if all(base.display.parallax):
            return sampled(whole, self.scene.lenses, lambda: self.store.rendered(base))
        mask = foreground(self.store.rendered(base))  # a square block in the middle of it
        middle = np.argwhere(mask).mean(0).astype(int) - BLOCK // 2
        row, column = np.clip(middle, 0, np.array(mask.shape) - BLOCK)
        return dataclasses.replace(whole, lens_list=tuple((int(row) + y, int(column) + x)
                                                          for y in range(BLOCK) for x in range(BLOCK)))

    def fill(self, reference_samples: int, renders: Iterable[Render]) -> None:
        self.store.render_all([self.reference(reference_samples), *map(self.job, renders)])


def read_settings(path: Path) -> Settings:
    try:
        return from_data(Settings, tomllib.loads(path.read_text(encoding="utf-8")), str(path))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise LfsrError(f"{path} cannot be read as settings ({error}): check the file") from None


def places(store: Store, settings: Settings, folders: Iterable[Path]) -> Iterator[Place]:
    """Yield the scenes whose files are below one of ``folders``."""
    for scene in settings.scenes:
        path = next((file for folder in folders if (file := folder / scene.file).is_file()), None)
        if path:
            yield Place(store, scene, path)


Key = tuple[str, Render, str]  # scene, render, method


@dataclasses.dataclass(frozen=True)
class Mean:
    """Means over the lenses of one render, finished by one method."""

    scene: str
    group: str
    scale: int
    samples: int
    seed: int
    method: str
    compared: bool  # whether the render has the scale at which methods are compared
    ssim: float
    flip: float
    relative: float


@dataclasses.dataclass(frozen=True)
class Record:
    environment: Environment | None
    means: tuple[Mean, ...]

    def mean(self, scene: str, samples: int, method: str, metric: str = "ssim") -> float | None:
        """Return the mean over the seeds of a scene, at the scale at which methods are compared."""
        figures = [getattr(mean, metric) for mean in self.means
                   if (mean.scene, mean.samples, mean.method, mean.compared) == (scene, samples, method, True)]
        return fmean(figures) if figures else None

    def group_mean(self, group: str, samples: int, method: str, metric: str = "ssim") -> float | None:
        """Return the mean over the scenes of a group that ``method`` can finish."""
        scenes = dict.fromkeys(mean.scene for mean in self.means if mean.group == group)
        means = [value for scene in scenes if (value := self.mean(scene, samples, method, metric)) is not None]
        return fmean(means) if means else None


def markdown(record: Record) -> str:
    """Return a table of the means of every group, and one of every scene."""
    methods = list(dict.fromkeys(mean.method for mean in record.means))
    samples = sorted({mean.samples for mean in record.means if mean.compared})
    groups = list(dict.fromkeys(mean.group for mean in record.means))
    scenes = list(dict.fromkeys(mean.scene for mean in record.means))
    tables = [[[count, name, *(" / ".join(number(get(name, count, method, metric)) for metric in METRICS)
                               for method in methods)] for count in samples for name in names]
              for names, get in ((groups, record.group_mean), (scenes, record.mean))]
    header = ["samples", "scenes", *(f"`{method}`" for method in methods)]
    return "\n\n".join([f"Each: {', '.join(METRICS.values())}.",
                        *("\n".join(markdown_table(header, rows, "rlr")) for rows in tables)])


BASELINES = ("oidn+bilinear", "oidn+pool", DEFAULT_METHOD)
CELLS = "cells"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENES", help="folders with the files of the settings")
    add("-m", "--method", action="append", default=[], metavar="METHOD[=WEIGHTS]", help="to judge, any number of times")
    add("--only", nargs="+", metavar="NAME", help="scenes or groups; default: all")
    add("--only-measure", action="store_true", help="render nothing")
    add("--settings", type=Path, default=SETTINGS, metavar="FILE.toml", help="default: denoiser.toml of the laboratory")


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write and print the tables."""
    settings, store = read_settings(arguments.settings), Store(arguments.output, arguments.blender)
    candidates = {candidate.label: candidate for candidate in map(Candidate.parse, [*arguments.method, *BASELINES])}
    chosen = [place for place in places(store, settings, arguments.scenes)
              if not arguments.only or {place.scene.name, place.scene.group} & {*arguments.only}]
    by_key: dict[Key, Figures] = {}
    for place in chosen:
        renders = settings.renders(place.scene)
        if not arguments.only_measure:
            place.fill(settings.reference_samples, renders)
        if FrameFolder(place.folder / REFERENCE).holds("reference"):
            by_key |= measured(place, renders, list(candidates.values()))
    scenes = {place.scene.name: place.scene for place in chosen}
    record = Record(environment(), tuple(
        Mean(name, scenes[name].group, render.scale, render.samples, render.seed, method,
             render.scale == scenes[name].scale, *(round(fmean(getattr(figures, metric)), 5) for metric in METRICS))
        for (name, render, method), figures in by_key.items()))
    print(write_report(arguments.output, "denoiser", record, {".md": lambda: markdown(record)})[1].read_text("utf-8"))


def measured(place: Place, renders: Iterable[Render],
             candidates: Sequence[Candidate]) -> dict[Key, Figures]:
    """Return the figures of what is rendered of a scene; each that is missing is measured now and stored at once."""
    by_key, truth = {}, Truth(place.folder / REFERENCE)
    for render in renders:
        folder, records = place.folder / render.folder, Records(place.folder / CELLS / render.folder, Figures)
        if FrameFolder(folder).holds():
            frame = read_frame(folder)
            for label, own in ((candidate.label, candidate.at(frame)) for candidate in candidates):
                if own:
                    by_key[place.scene.name, render, label] = records.get(
                        label, own.facts(folder, truth.folder),
                        functools.partial(measure, folder, truth, own))
    return by_key
