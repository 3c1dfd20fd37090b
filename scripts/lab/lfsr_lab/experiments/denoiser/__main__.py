"""Judge denoisers on known and unprepared scenes, against references of a few lenses.

    python -m lfsr_lab.experiments.denoiser SCENES… -o OUT -m METHOD -m METHOD=WEIGHTS

SCENES are folders in which the files of denoiser.toml are looked for; scenes that are in none of them are left out.
What is complete in OUT is not done again. Without --only-measure missing renders are made, some minutes a scene. The
differences are against BASELINES, which are measured too. OUT/denoiser.md has the tables, denoiser.json the means.
"""

from __future__ import annotations

import argparse
import functools
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from lfsr_core.base.records import write_record
from lfsr_core.frames.frame import read_frame
from lfsr_core.pipeline.store import is_complete
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_lab.experiments.denoiser.measure import Candidate, Figures, measure
from lfsr_lab.experiments.denoiser.page import Key, Page
from lfsr_lab.experiments.denoiser.records import Record, means
from lfsr_lab.experiments.denoiser.settings import SETTINGS, Place, Render, places, read_settings
from lfsr_lab.experiments.engine.environment import environment
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.renders import REFERENCE, Store
from lfsr_lab.experiments.engine.report import exit_code, write_text
from lfsr_lab.experiments.engine.truth import Truth

BASELINES = ("oidn+bilinear", "oidn+bilinear+epi", DEFAULT_METHOD)
CELLS = "cells"


def main(argv: Sequence[str] | None = None) -> int:
    """Return the exit code: 0, 2 after bad input, 130 if stopped."""
    arguments = _parser().parse_args(argv)
    return exit_code("denoiser", lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write and print the tables."""
    settings, store = read_settings(arguments.settings), Store(arguments.output, arguments.blender)
    candidates = {each.label: each for each in map(Candidate.parse, [*arguments.method, *BASELINES])}
    chosen = [place for place in places(store, settings, arguments.scenes)
              if not arguments.only or {place.scene.name, place.scene.group} & {*arguments.only}]
    found: dict[Key, Figures] = {}
    for place in chosen:
        renders = [each for each in settings.renders(place.scene) if not arguments.samples
                   or (each.scale == place.scene.scale and each.samples in arguments.samples)]
        if not arguments.only_measure:
            place.fill(settings.reference_samples, renders)
        if is_complete(place.folder / REFERENCE, "reference"):
            found |= measured(place, renders, list(candidates.values()))
    scenes = [place.scene for place in chosen]
    write_record(arguments.output / "denoiser.json", Record(environment(), tuple(means(scenes, found))))
    page = Page(settings, scenes, list(candidates), BASELINES, found)
    print(write_text(arguments.output / "denoiser.md", page.markdown()).read_text(encoding="utf-8"))


def measured(place: Place, renders: Iterable[Render], candidates: Sequence[Candidate]) -> dict[Key, Figures]:
    """Return the figures of what is rendered of a scene; each that is missing is measured now and stored at once."""
    found, truth = {}, Truth(place.folder / REFERENCE)
    for render in renders:
        folder, records = place.folder / render.folder, Records(place.folder / CELLS / render.folder, Figures)
        if is_complete(folder):
            frame = read_frame(folder)
            for label, own in ((each.label, each.at(frame)) for each in candidates):
                if own:
                    found[place.scene.name, render, label] = records.get(
                        label, own.facts(folder, truth.folder), functools.partial(measure, folder, truth, own))
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m lfsr_lab.experiments.denoiser",
                                     description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENES", help="folders with the files of the settings")
    add("-o", "--output", type=Path, required=True, metavar="OUT", help="folder of everything that is made")
    add("-m", "--method", action="append", default=[], metavar="METHOD[=WEIGHTS]", help="to judge, any number of times")
    add("--only", nargs="+", metavar="NAME", help="scenes or groups; default: all")
    add("--samples", type=int, nargs="+", metavar="N", help="only these samples, no scales at equal rays")
    add("--only-measure", action="store_true", help="render nothing")
    add("--settings", type=Path, default=SETTINGS, metavar="FILE.toml", help="default: denoiser.toml of the laboratory")
    add("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")
    return parser


if __name__ == "__main__":
    sys.exit(main())
