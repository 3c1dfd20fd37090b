"""``lfsr fit DIR REFDIR -o FILE``."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path

from lfsr_core.progress import ProgressBar
from lfsr_lab.verbs.train import training_packages

NAME = "fit"
HELP = "fit our network to one scene, from a few reference lenses; use it with `--weights FILE`"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="frame folder of `lfsr render`")
    parser.add_argument("reference", type=Path, metavar="REFDIR", help="folder of `lfsr reference`, whole or sampled")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE",
                        help="weights to write, .safetensors")
    parser.add_argument("--network", default="refine", metavar="NAME", help="refine or light, default: %(default)s")
    parser.add_argument("--lenses", type=int, default=24, metavar="N",
                        help="foreground lenses to learn from; the reference's others check it, default: %(default)s")
    parser.add_argument("--seconds", type=float, default=60, metavar="N", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, metavar="N")


def run(arguments: argparse.Namespace) -> None:
    """Fit a network and print its gain on lenses that the fit has not seen."""
    with training_packages(), closing(ProgressBar()) as progress:
        from lfsr_lab.train.fit import FitOptions, fit

        options = FitOptions(arguments.network, arguments.lenses, arguments.seconds, arguments.seed)
        fitted = fit(arguments.folder, arguments.reference, arguments.output, options, progress)
    print(f"{arguments.output}: {fitted.lenses} lenses, {fitted.steps} steps; split SSIM of "
          f"{fitted.unseen_lenses} other lenses {fitted.before:.4f} before, {fitted.after:.4f} after")
