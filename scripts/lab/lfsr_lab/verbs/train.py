"""``lfsr train CONFIG`` and ``lfsr train --prepare-photographs SOURCE --cache FILE``."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.progress import ProgressBar

NAME = "train"
HELP = "train a network as a TOML config says, or pack photographs for another machine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("config", nargs="?", metavar="CONFIG", help="TOML file, or a built-in name such as paper-short")
    parser.add_argument("--output", default=None, help="folder for weights, log, curves and checkpoint "
                                                       "(default: out/train/CONFIG)")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint in the output folder")
    parser.add_argument("--device", default="auto", choices=("auto", "cpu", "cuda"))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a setting")
    parser.add_argument("--prepare-photographs", metavar="SOURCE", help="folder of photographs to pack into --cache")
    parser.add_argument("--cache", metavar="FILE.npz", help="packed photographs to write")
    parser.add_argument("--long-side", type=int, default=1024, help="reduce packed photographs to this many pixels")
    parser.add_argument("--quality", type=int, default=92, help="JPEG quality of packed ones; 101 is lossless")


def run(arguments: argparse.Namespace) -> None:
    """Train, or pack photographs, and print what came of it."""
    if not (arguments.prepare_photographs or arguments.config):
        raise LfsrError("nothing to train: give a CONFIG such as paper-short, or --prepare-photographs")
    with training_packages():
        (prepare if arguments.prepare_photographs else train)(arguments)


@contextmanager
def training_packages() -> Iterator[None]:
    """LfsrError where an import inside the block finds that a package of the extra "training" is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise LfsrError(f"training needs the Python package {error.name!r}, which is not installed: "
                        f"install lfsr[training]") from None


def prepare(arguments: argparse.Namespace) -> None:
    """Pack a folder of photographs into one file."""
    from lfsr_lab.train.photographs.data import load_photographs, write_cache

    if not arguments.cache:
        raise LfsrError("--prepare-photographs has no file to write: add --cache FILE.npz")
    photographs = load_photographs(arguments.prepare_photographs, arguments.long_side)
    size = write_cache(photographs, arguments.cache, arguments.quality)
    print(f"{arguments.cache}: {len(photographs.images)} photographs, {size / 1e6:.1f} MB")


def train(arguments: argparse.Namespace) -> None:
    """Train and print the weights file with its validation figures."""
    from lfsr_lab.train import session
    from lfsr_lab.train.config import load_config
    from lfsr_lab.train.loop import RunOptions

    config = load_config(arguments.config, arguments.set)
    output = Path(arguments.output or f"out/train/{Path(arguments.config).stem}-x{config.scale}")
    with closing(ProgressBar()) as bar:
        trained = session.train(config, output, arguments.device, RunOptions(arguments.resume, bar))
    if trained.weights is None:
        print(f"stopped after {trained.epochs} epochs: go on with --resume --output {output}")
        raise KeyboardInterrupt
    figures = ", ".join(f"{name} {value:g}" for name, value in trained.validation.items())
    print(f"{trained.weights} after {trained.seconds:.0f} s; {figures}")
