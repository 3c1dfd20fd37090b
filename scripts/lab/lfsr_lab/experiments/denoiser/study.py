"""Judge denoisers on known and unprepared scenes, against references of a few lenses.

SCENES are folders in which the files of denoiser.toml are looked for; scenes that are in none of them are left out.
What is complete in OUT is not done again. Without --only-measure missing renders are made, some minutes a scene.
BASELINES are measured too. OUT/denoiser.md has the tables, denoiser.json the means.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import fmean

from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import read_frame
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_lab.experiments.denoiser import measure as measuring
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.renders import REFERENCE, Store
from lfsr_lab.experiments.engine.report import Environment, environment, markdown_table, number, write_report
from lfsr_lab.experiments.engine.truth import Figures, Truth

Key = tuple[str, measuring.Render, str]  # scene, render, method


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


BASELINES = ("oidn+bilinear", "oidn+pool", DEFAULT_METHOD)
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
    record = Record(environment(), tuple(means(scenes, found)))
    print(write_report(arguments.output, "denoiser", record, {".md": lambda: markdown(record)})[1].read_text("utf-8"))


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
