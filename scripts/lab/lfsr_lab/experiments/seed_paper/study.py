"""The paper's figures and tables, measured again: hours on a CPU, with --quick minutes, on tiny frames.

OUT/results.json, OUT/paper.md and OUT/images are written after every figure; --docs also puts the page and its images
there, as in --only fig10a,table3 --docs docs.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, write_json
from lfsr_core.base.records import from_data, to_data
from lfsr_lab.experiments.engine.plots import save
from lfsr_lab.experiments.engine.report import environment, write_text
from lfsr_lab.experiments.seed_paper import page, renders
from lfsr_lab.experiments.seed_paper.figure import Results

RESULTS_FILE, PAGE_FILE, IMAGES = "results.json", "paper.md", "images"
PAGE_IN_DOCS = "notebook/paper.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--scenes", type=Path, nargs="+", default=[], metavar="FILE", help="default: the demo scene")
    add("--quick", action="store_true", help="tiny frames and few samples: every figure in minutes")
    add("--only", metavar="ID,ID", help=f"of {', '.join(page.FIGURES)}")
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
    figures = page.chosen(arguments.only)
    if arguments.weights is not None and not arguments.weights.is_dir():
        raise LfsrError(f"--weights {arguments.weights} is not a folder: give one with NAME-x{renders.SCALE}"
                        ".safetensors files")
    scenes = tuple(arguments.scenes) or (renders.demo_scene(arguments.output, arguments.blender),)
    chosen = renders.make_settings(**renders.Settings.given(arguments) | {"scenes": scenes})
    machine = environment()
    text = page.run_text(chosen, machine, arguments.command)
    file, facts = chosen.output / RESULTS_FILE, chosen.facts()
    results = _earlier(file, facts)
    for figure in figures:
        found = results[figure.id] = figure.measure(chosen)
        write_json(file, {"settings": facts, "environment": to_data(machine), "command": arguments.command,
                          "figures": {name: to_data(of) for name, of in results.items()}})
        sheet = figure.draw(found.rows, chosen.output / renders.CELLS / figure.id) if figure.draw else None
        pages = {chosen.output: (PAGE_FILE, IMAGES)}
        if arguments.docs:
            pages[arguments.docs] = PAGE_IN_DOCS, f"../{IMAGES}"
        for folder, (page_file, images) in pages.items():
            if sheet:
                save(sheet, folder / IMAGES / figure.image)
            write_text(folder / page_file, page.markdown(results, text, images))
        print(f"{figure.title}: {figure.line(found)}", flush=True)


def _earlier(path: Path, facts: dict[str, Any]) -> dict[str, Results]:
    """Return the figures of an earlier run with the same settings, none where they differ."""
    if not path.exists():
        return {}
    data = read_json(path, "the results of an earlier run")
    if data.get("settings") == facts:
        return {name: from_data(Results, found, str(path)) for name, found in data["figures"].items()}
    print(f"{path} has other settings: its figures leave the page, their measurements stay", file=sys.stderr)
    return {}
