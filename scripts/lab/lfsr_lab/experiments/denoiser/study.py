"""Judge denoisers on known and unprepared scenes, against references of a few lenses.

SCENES are folders in which the files of denoiser.toml are looked for; scenes that are in none of them are left out.
What is complete in OUT is not done again. Without --only-measure missing renders are made, some minutes a scene. The
differences are against BASELINES, which are measured too. OUT/denoiser.md has the tables, denoiser.json the means.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import fmean

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.records import write_record
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import read_frame
from lfsr_core.metrics.intervals import student_95
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_lab.experiments.denoiser import measure as measuring
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.renders import REFERENCE, Store
from lfsr_lab.experiments.engine.report import Environment, environment, markdown_table, number, write_text
from lfsr_lab.experiments.engine.truth import Figures, Truth

Key = tuple[str, measuring.Render, str]  # scene, render, method
Estimate = tuple[float, float]  # mean and half-width of its 95 % interval
Rows = list[tuple[str, list[measuring.Scene]]]


@dataclasses.dataclass(frozen=True)
class Page:
    settings: measuring.Settings
    scenes: Sequence[measuring.Scene]
    methods: Sequence[str]
    baselines: Sequence[str]  # those of ``methods`` that the others are compared with
    found: Mapping[Key, Figures]

    def markdown(self) -> str:
        lines, judged = ["# Denoisers"], [name for name in self.methods if name not in self.baselines]
        for samples in sorted({*self.settings.repeated, *self.settings.once}):
            scenes = [scene for scene in self.scenes
                      if any(self._values(scene, samples, name).size for name in self.methods)]
            whole = [scene for scene in scenes if all(self._values(scene, samples, name).size for name in self.methods)]
            groups = [(f"**{group}**", [scene for scene in whole if scene.group == group])
                      for group in dict.fromkeys(scene.group for scene in whole)]
            rows = [*((scene.name, [scene]) for scene in scenes), *groups, ("**all**", whole)] if whole else []
            if rows:
                lines += ["", f"## {samples} samples", "", *self._accuracy(samples, rows)]
            for name in judged if rows else ():
                lines += ["", f"`ssim_lens_fg` of `{name}` minus that of each, 95 % intervals over lenses and seeds:",
                          "", *self._differences(name, samples, rows)]
        for name in self.methods:
            lines += self._scales(name)
        return "\n".join(lines) + "\n"

    def _accuracy(self, samples: int, rows: Rows) -> list[str]:
        def cell(scenes: list[measuring.Scene], name: str) -> str:
            means = [[self._values(scene, samples, name, metric).mean()
                      for metric in (*measuring.METRICS, "cpu_seconds")]
                     for scene in scenes if self._values(scene, samples, name).size]
            return " ".join(number(value, digits=4) for value in np.mean(means, 0)) if means else number(None)

        return [f"Each: {', '.join(measuring.METRICS.values())}, CPU seconds.", "", *markdown_table(
            ["scene", *(f"`{name}`" for name in self.methods)],
            [[title, *(cell(scenes, name) for name in self.methods)] for title, scenes in rows], "lr")]

    def _differences(self, method: str, samples: int, rows: Rows) -> list[str]:
        """Return the table of differences from every baseline, and from the best of them in each scene."""
        cells: list[list[object]] = []
        for title, scenes in rows:
            each = {other: [difference(self._values(scene, samples, method), values) for scene in scenes
                            if (values := self._values(scene, samples, other)).size] for other in self.baselines}
            worst = np.mean([min(value for value, _ in found) for found in zip(*filter(None, each.values()),
                                                                              strict=True)])
            cells.append([title, *(_text(mean(found)) if found else number(None) for found in each.values()),
                          f"{worst:+.4f}"])
        return markdown_table(["scene", *(f"`{name}`" for name in self.baselines), "the best of them"], cells, "lr")

    def _values(self, scene: measuring.Scene, samples: int, method: str, metric: str = "ssim") -> Array:
        """Return what was measured at the scene's scale, (seeds, lenses); empty where nothing was."""
        return np.array([getattr(figures, metric) for (name, render, label), figures in self.found.items()
                         if (name, label, render.scale, render.samples) == (scene.name, method, scene.scale, samples)])

    def _scales(self, method: str) -> list[str]:
        """Return the tables of scales at equal rays."""
        lines: list[str] = []
        for rays in self.settings.rays:
            found = {scene.name: {render.scale: np.array([self.found[key].ssim])
                                  for render in self.settings.at_rays(scene)[rays]
                                  if (key := (scene.name, render, method)) in self.found} for scene in self.scenes}
            found = {name: each for name, each in found.items() if len(each) > 1}
            scales = sorted({scale for each in found.values() for scale in each})
            rows = [[name, *(number(each[scale].mean(), digits=4) if scale in each else number(None)
                             for scale in scales), max(each, key=lambda scale: each[scale].mean()),
                     _text(difference(each[2], each[4])) if {2, 4} <= each.keys() else number(None)]
                    for name, each in found.items()]
            if rows:
                lines += ["", f"## Scales with equal rays ({rays}), `{method}`", "", *markdown_table(
                    ["scene", *(f"scale {scale}" for scale in scales), "best", "2 minus 4"], rows, "lr")]
        return lines


def difference(values: Array, others: Array) -> Estimate:
    """Return the mean of differences (seeds, lenses) in pairs: a lens counts once, with the mean of its seeds."""
    lenses = (values - others).mean(0)
    half = student_95(len(lenses) - 1) * lenses.std(ddof=1) / math.sqrt(len(lenses)) if len(lenses) > 1 else 0.0
    return float(lenses.mean()), float(half)


def mean(estimates: Sequence[Estimate]) -> Estimate:
    values, halves = np.transpose(estimates)
    return float(values.mean()), math.sqrt(halves @ halves) / len(halves)


def _text(estimate: Estimate) -> str:
    return f"{estimate[0]:+.4f} ± {estimate[1]:.4f}"


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
        found = [getattr(each, metric) for each in self.means
                 if (each.scene, each.samples, each.method, each.compared) == (scene, samples, method, True)]
        return fmean(found) if found else None

    def group_mean(self, group: str, samples: int, method: str, metric: str = "ssim") -> float | None:
        """Return the mean over the scenes of a group that ``method`` can finish."""
        scenes = dict.fromkeys(each.scene for each in self.means if each.group == group)
        known = [value for scene in scenes if (value := self.mean(scene, samples, method, metric)) is not None]
        return fmean(known) if known else None


def means(scenes: Sequence[measuring.Scene], found: Mapping[Key, Figures]) -> Iterator[Mean]:
    known = {scene.name: scene for scene in scenes}
    for (name, render, method), figures in found.items():
        scene = known[name]
        yield Mean(name, scene.group, render.scale, render.samples, render.seed, method, render.scale == scene.scale,
                   *(round(fmean(getattr(figures, metric)), 5) for metric in measuring.METRICS))


def markdown(record: Record) -> str:
    """Return a table of the means of every group, and one of every scene."""
    methods = list(dict.fromkeys(each.method for each in record.means))
    samples = sorted({each.samples for each in record.means if each.compared})
    groups = list(dict.fromkeys(each.group for each in record.means))
    scenes = list(dict.fromkeys(each.scene for each in record.means))
    tables = [[[count, name, *(" / ".join(number(get(name, count, method, metric)) for metric in measuring.METRICS)
                               for method in methods)] for count in samples for name in names]
              for names, get in ((groups, record.group_mean), (scenes, record.mean))]
    header = ["samples", "scenes", *(f"`{method}`" for method in methods)]
    return "\n\n".join([f"Each: {', '.join(measuring.METRICS.values())}.",
                        *("\n".join(markdown_table(header, rows, "rlr")) for rows in tables)])


BASELINES = ("oidn+bilinear", "oidn+bilinear+epi", DEFAULT_METHOD)
CELLS = "cells"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENES", help="folders with the files of the settings")
    add("-m", "--method", action="append", default=[], metavar="METHOD[=WEIGHTS]", help="to judge, any number of times")
    add("--only", nargs="+", metavar="NAME", help="scenes or groups; default: all")
    add("--samples", type=int, nargs="+", metavar="N", help="only these samples, no scales at equal rays")
    add("--only-measure", action="store_true", help="render nothing")
    add("--settings", type=Path, default=measuring.SETTINGS, metavar="FILE.toml",
        help="default: denoiser.toml of the laboratory")


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write and print the tables."""
    settings, store = measuring.read_settings(arguments.settings), Store(arguments.output, arguments.blender)
    candidates = {each.label: each for each in map(measuring.Candidate.parse, [*arguments.method, *BASELINES])}
    chosen = [place for place in measuring.places(store, settings, arguments.scenes)
              if not arguments.only or {place.scene.name, place.scene.group} & {*arguments.only}]
    found: dict[Key, Figures] = {}
    for place in chosen:
        renders = [each for each in settings.renders(place.scene) if not arguments.samples
                   or (each.scale == place.scene.scale and each.samples in arguments.samples)]
        if not arguments.only_measure:
            place.fill(settings.reference_samples, renders)
        if FrameFolder(place.folder / REFERENCE).holds("reference"):
            found |= measured(place, renders, list(candidates.values()))
    scenes = [place.scene for place in chosen]
    write_record(arguments.output / "denoiser.json", Record(environment(), tuple(means(scenes, found))))
    page = Page(settings, scenes, list(candidates), BASELINES, found)
    print(write_text(arguments.output / "denoiser.md", page.markdown()).read_text(encoding="utf-8"))


def measured(place: measuring.Place, renders: Iterable[measuring.Render],
             candidates: Sequence[measuring.Candidate]) -> dict[Key, Figures]:
    """Return the figures of what is rendered of a scene; each that is missing is measured now and stored at once."""
    found, truth = {}, Truth(place.folder / REFERENCE)
    for render in renders:
        folder, records = place.folder / render.folder, Records(place.folder / CELLS / render.folder, Figures)
        if FrameFolder(folder).holds():
            frame = read_frame(folder)
            for label, own in ((each.label, each.at(frame)) for each in candidates):
                if own:
                    found[place.scene.name, render, label] = records.get(
                        label, own.facts(folder, truth.folder),
                        functools.partial(measuring.measure, folder, truth, own))
    return found
