"""``lfsr stress -o DIR``: every method along every parameter sweep, to its breaking point."""

from __future__ import annotations

import argparse
from pathlib import Path

from lfsr_core.commands.arguments import names

NAME = "stress"
HELP = "parameter sweeps: generated scenes that grow harder, every method to its breaking point"
SAMPLES, QUICK_SAMPLES, FRAMES, QUICK_FRAMES, SCALE = 256, 32, 24, 4, 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR",
                        help="folder of everything that is made; what is complete in it is not made again")
    parser.add_argument("--sweeps", type=names, metavar="NAME,NAME", help="default: all, see docs/results/stress.md")
    parser.add_argument("--methods", type=names, metavar="NAME,NAME",
                        help="bicubic is added; default: bicubic, the default method, every network with weights")
    parser.add_argument("--quick", action="store_true",
                        help=f"few values, references of {QUICK_SAMPLES} samples, {QUICK_FRAMES} frames of motion")
    parser.add_argument("--display", metavar="NAME|FILE.toml", help="default: the sweeps' own, 12×8 lenses")
    parser.add_argument("--scale", type=int, default=SCALE, metavar="N", help="default: %(default)s")
    parser.add_argument("--reference-spp", type=int, metavar="N",
                        help=f"of both halves of a reference together, default: {SAMPLES}")
    parser.add_argument("--seeds", type=int, default=1, metavar="N",
                        help="of the renders' noise at the values where methods break, default: %(default)s")
    parser.add_argument("--frames", type=int, metavar="N", help=f"of the moving card, default: {FRAMES}")
    parser.add_argument("--device", default="CPU", metavar="NAME", help="Cycles device, default: %(default)s")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")


def run(arguments: argparse.Namespace) -> None:
    """Measure what is missing and write tables, curves and images."""
    from lfsr_lab.experiments.engine.environment import check_packages

    check_packages()
    from lfsr_core.optics.display import load_display
    from lfsr_lab.experiments.engine.renders import Store
    from lfsr_lab.experiments.sweeps.measure import DISPLAY_FILE, default_methods
    from lfsr_lab.experiments.sweeps.page import run as run_sweeps
    from lfsr_lab.experiments.sweeps.records import Settings

    samples = arguments.reference_spp or (QUICK_SAMPLES if arguments.quick else SAMPLES)
    frames = arguments.frames or (QUICK_FRAMES if arguments.quick else FRAMES)
    settings = Settings(load_display(arguments.display or DISPLAY_FILE), arguments.scale, samples, frames,
                        arguments.device)
    methods = arguments.methods or default_methods(settings.scale, settings.display.parallax)
    store = Store(arguments.output, arguments.blender)
    report = run_sweeps(store, settings, methods, arguments.sweeps, arguments.quick, arguments.seeds)
    print((report.parent / "stress.md").read_text(encoding="utf-8"))
    print(f"{report.parent / 'index.html'}: curves and the worst crop of every method")
