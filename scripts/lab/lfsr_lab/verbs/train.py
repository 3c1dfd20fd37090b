"""``lfsr train CONFIG``."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lfsr_core.base.messages import LfsrError

NAME = "train"
HELP = "train a network as a TOML config says"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("config", metavar="CONFIG", help="TOML file, or a built-in name such as paper-short")
    parser.add_argument("--output", default=None, help="folder for weights, log, curves and checkpoint "
                                                       "(default: out/train/CONFIG)")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint in the output folder")
    parser.add_argument("--device", default="auto", choices=("auto", "cpu", "cuda"))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a setting")


@contextmanager
def training_packages() -> Iterator[None]:
    """LfsrError where an import inside the block finds that a package of the extra "training" is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise LfsrError(f"training needs the Python package {error.name!r}, which is not installed: "
                        f"install lfsr-lab[training]") from None


def run(arguments: argparse.Namespace) -> None:
    """Train and print the weights file with its validation figures."""
    from lfsr_core.commands.common import progress

    with training_packages(), progress() as tell:
        from lfsr_lab.train import session
        from lfsr_lab.train.config import load_config
        from lfsr_lab.train.loop import RunOptions

        config = load_config(arguments.config, arguments.set)
        output = Path(arguments.output or f"out/train/{Path(arguments.config).stem}")
        trained = session.train(config, output, arguments.device, RunOptions(arguments.resume, tell))
    if trained.weights is None:
        print(f"stopped after {trained.epochs} epochs: go on with --resume --output {output}")
        raise KeyboardInterrupt
    figures = ", ".join(f"{name} {value:g}" for name, value in trained.validation.items())
    print(f"{trained.weights} after {trained.seconds:.0f} s; {figures}")
