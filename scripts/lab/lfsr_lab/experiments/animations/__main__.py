"""Temporal averaging of animations, measured by one command that can be stopped and started again.

    python -m lfsr_lab.experiments.animations -o OUT         everything, half an hour on two cores
    python -m lfsr_lab.experiments.animations --cost NAME    only what averaging costs on a display, at scale 4

What is complete in OUT is not done again. docs/results/animations.md shows OUT/shots.json, shots.md and shots.svg.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfsr_core.optics.display import load_display
from lfsr_lab.experiments.animations.accuracy import Figures, cost_of_averaging
from lfsr_lab.experiments.animations.cells import NAMES, Animation, Settings, build_scenes
from lfsr_lab.experiments.animations.report import STEM, Found, Report, chart, markdown
from lfsr_lab.experiments.engine.cells import measured
from lfsr_lab.experiments.engine.environment import check_packages, environment
from lfsr_lab.experiments.engine.plots import svg
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import exit_code, write_report

COST_SCALE = 4


def main(argv: Sequence[str] | None = None) -> int:
    """Return the exit code: 0, 2 after bad input, 130 if stopped."""
    arguments = _parser().parse_args(argv)
    return exit_code("animations", lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the report."""
    if arguments.cost:
        seconds = cost_of_averaging(load_display(arguments.cost), COST_SCALE)
        print(f"{arguments.cost}, scale {COST_SCALE}: {seconds:.2f} CPU seconds per neighbouring frame")
        return
    check_packages()
    settings = Settings(seed=arguments.seed)
    store = Store(arguments.output, arguments.blender)
    store.claim(settings)
    build_scenes(store, settings)
    found = tuple(each for name in arguments.only for each in _measured(Animation(store, settings, name)))
    command = f"python -m lfsr_lab.experiments.animations -o OUT --seed {arguments.seed}"
    write_report(arguments.output, STEM, Report(settings, environment(), command, found),
                 {".md": lambda: markdown(found), ".svg": lambda: svg(chart(found))})
    print(markdown(found))


def _measured(animation: Animation) -> Iterator[Found]:
    records = Records(animation.folder / "cells", Figures)
    for way, spp, cell in animation.cells():
        for figures in measured([cell], records, animation.store):
            print(f"{animation.name}, {way.name}, {spp} samples: split SSIM {figures.ssim:.4f}, flicker "
                  f"{figures.flicker:.2f}, low-frequency error {figures.offset:.2f}, lag {figures.lag:.2f}", flush=True)
            yield Found(animation.name, way.name, spp, figures)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m lfsr_lab.experiments.animations",
                                     description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("animations"), metavar="OUT",
                        help="folder of everything that is made, default: %(default)s")
    parser.add_argument("--cost", metavar="NAME", help="display on which to measure only what averaging costs")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES, help="default: all")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of renders, default: %(default)s")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")
    return parser


if __name__ == "__main__":
    sys.exit(main())
