"""The paper's figures and tables, measured again: hours on a CPU, with --quick minutes, on tiny frames.

OUT/results.json, OUT/paper.md and OUT/images are written after every figure; --docs also puts the page and its images
there, as in --only fig10a,table3 --docs docs.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data, to_data
from lfsr_core.base.system import read_json, write_json
from lfsr_lab.experiments.engine.plots import save
from lfsr_lab.experiments.engine.report import Environment, environment, write_text
from lfsr_lab.experiments.seed_paper import measuring
from lfsr_lab.experiments.seed_paper.figure import Figure
from lfsr_lab.experiments.seed_paper.figures import frames, images
from lfsr_lab.experiments.seed_paper.figures.networks import ARCHITECTURE, COST, DEPTH, STEPS
from lfsr_lab.experiments.seed_paper.measuring import SCALE, Results, Settings

FIGURES: dict[str, Figure] = {figure.id: figure for figure in (
    images.FIG9, STEPS, frames.FRACTION, DEPTH, ARCHITECTURE, images.FIG11, frames.SCALES,
    frames.SCENES, frames.TABLE2, COST)}
"""Every figure and table by its id, in the paper's order."""

INTRODUCTION = """# The paper, measured again

"Real-time optical reconstruction for a three-dimensional light-field display based on path-tracing and CNN
super-resolution", Optics Express 29(23), 37862 (2021). Its abstract claims more than 30 frames per second at 8K with
an SSIM that can be over 0.90, from a low-resolution path-traced EIA, elemental images that a light network (trained
with an adversary) super-resolves one by one, and foreground selection.

Its text and curves were not at hand: the claims below are as far as they are known here. Its graphics card, scenes and
lens count are not known either, so times are compared with times of this machine only.

Every sentence beside a figure is derived from the numbers. "Holds" and "other way round" mean that the 95 % interval
of the paired difference (the same lenses, or runs taken in turns) lies on that side of zero; neighbouring lenses
resemble each other, so these intervals are rather too narrow.
SSIM is the split estimate of [metrics.md](../reference/metrics.md) unless it is called plain."""
QUICK = "**Quick mode: tiny frames and few samples, which touch every figure but decide nothing.**"


def chosen(only: str | None) -> list[Figure]:
    """Return the figures of a comma-separated list of ids, all without one; LfsrError for an unknown id."""
    names = list(FIGURES) if only is None else [name.strip() for name in only.split(",") if name.strip()]
    for name in names:
        if name not in FIGURES:
            raise LfsrError(f"there is no figure {name!r}: choose from {', '.join(FIGURES)}")
    return [figure for name, figure in FIGURES.items() if name in names]


def markdown(results: Mapping[str, Results], run: Sequence[str], folder: str = "images") -> str:
    """Return the page of the figures in ``results``, by id, of a ``run``; ``folder`` holds the images."""
    there = [figure for name, figure in FIGURES.items() if name in results]
    parts = [INTRODUCTION, *run, *("\n".join(_section(figure, results[figure.id], folder)) for figure in there)]
    absent = [figure.title for name, figure in FIGURES.items() if name not in results]
    if absent:
        parts.append("## Not measured in this run\n\n" + "; ".join(absent))
    return "\n\n".join(parts) + "\n"


def _section(figure: Figure, results: Results, folder: str) -> list[str]:
    image = ["", f"![{figure.title}]({folder}/{figure.image})"] if figure.draw else []
    trained = [f"- {name}: {text}" for name, text in results.schedules.items()]
    networks = ["", "Networks (the paper's recipes are in lfsr_lab/train/configs):", "", *trained] if trained else []
    # This program's own threads count too.
    load = [] if results.load is None else ["", f"Load average while this was measured: at most {results.load:g}."]
    return [f"## {figure.title}", "", f"Claim: {figure.claim}", "", f"Here: {figure.line(results)}", *image, "",
            *figure.table(results.rows), *networks, *load]


def run_text(of: Settings, machine: Environment, command: str) -> list[str]:
    """Return paragraphs about a run: its command line, what it measures and on which machine."""
    return [*([QUICK] if of.quick else []), "## The run", "    " + command,
            f"Accuracy on `{of.display.name}`, times of whole frames on `{of.timing_display.name}`; s = {SCALE}, "
            f"{of.spp} samples per pixel ({of.clean_spp} where noise should not matter, {of.reference_spp} of "
            f"references), rendered on {of.render_device}. Scenes: {', '.join(scene.stem for scene in of.scenes)}. "
            f"{machine.machine}, Python {machine.python}, {machine.packages}."]


RESULTS_FILE, PAGE_FILE, IMAGES = "results.json", "paper.md", "images"
PAGE_IN_DOCS = "notebook/paper.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--scenes", type=Path, nargs="+", default=[], metavar="FILE", help="default: the demo scene")
    add("--quick", action="store_true", help="tiny frames and few samples: every figure in minutes")
    add("--only", metavar="ID,ID", help=f"of {', '.join(FIGURES)}")
    add("--docs", type=Path, metavar="DIR", help="also write notebook/paper.md and images/paper-*.png there")
    add("--bench", type=Path, metavar="DIR", help="folder with renders on --display to reuse and add to")
    add("--display", metavar="NAME|FILE.toml", help="for accuracy; default: small")
    add("--timing-display", metavar="NAME|FILE.toml", help="for times of whole frames; default: bupt-32in-8k")
    add("--spp", type=int, metavar="N", help="samples a user renders with, default: 16")
    add("--clean-spp", type=int, metavar="N", help="samples where noise should not matter, default: 4096")
    add("--reference-spp", type=int, metavar="N", help="default: 1024")
    add("--weights", type=Path, metavar="DIR", help="trained networks, NAME-x4.safetensors")
    add("--train-epochs", type=int, metavar="N", help="train each network that --weights lacks by the short recipe")
    add("--photographs", metavar="DIR", help="to train with; default: as in lfsr_lab/train/configs")
    add("--device", choices=("auto", "cpu", "cuda"), help="for networks, default: auto")
    add("--render-device", metavar="NAME", help="Cycles device, default: CPU")
    add("--repeats", type=int, metavar="N", help="runs of everything timed but renders, default: 10")


def run(arguments: argparse.Namespace) -> None:
    """Measure, draw and write figure by figure; figures of earlier runs with the same settings stay."""
    figures = chosen(arguments.only)
    if arguments.weights is not None and not arguments.weights.is_dir():
        raise LfsrError(f"--weights {arguments.weights} is not a folder: give one with NAME-x{SCALE}.safetensors files")
    scenes = tuple(arguments.scenes) or (measuring.demo_scene(arguments.output, arguments.blender),)
    settings = measuring.make_settings(**Settings.given(arguments) | {"scenes": scenes})
    machine = environment()
    text = run_text(settings, machine, arguments.command)
    file, facts = settings.output / RESULTS_FILE, settings.facts()
    results: dict[str, Results] = {}
    if file.exists():
        data = read_json(file, "the results of an earlier run")
        if data.get("settings") == facts:
            results = {name: from_data(Results, entry, str(file)) for name, entry in data["figures"].items()}
        else:
            print(f"{file} has other settings: its figures leave the page, their measurements stay", file=sys.stderr)
    for figure in figures:
        measured = results[figure.id] = figure.measure(settings)
        write_json(file, {"settings": facts, "environment": to_data(machine), "command": arguments.command,
                          "figures": {name: to_data(of) for name, of in results.items()}})
        sheet = figure.draw(measured.rows, settings.output / measuring.CELLS / figure.id) if figure.draw else None
        pages = {settings.output: (PAGE_FILE, IMAGES)}
        if arguments.docs:
            pages[arguments.docs] = PAGE_IN_DOCS, f"../{IMAGES}"
        for folder, (page_file, pictures) in pages.items():
            if sheet:
                save(sheet, folder / IMAGES / figure.image)
            write_text(folder / page_file, markdown(results, text, pictures))
        print(f"{figure.title}: {figure.line(measured)}", flush=True)

