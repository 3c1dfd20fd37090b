"""``lfsr merge PARTS… -o DIR``: parts of a frame, rendered on several machines, become one."""

from __future__ import annotations

import argparse
from pathlib import Path

from lfsr_core.progress import ProgressBar

NAME = "merge"
HELP = "join parts of `lfsr render --rows` or `lfsr reference --rows`, or average references of other seeds"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("parts", type=Path, nargs="+", metavar="PART", help="folder of a part, in any order")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")


def run(arguments: argparse.Namespace) -> None:
    """Join them and say what to do next."""
    from lfsr_core.render.merge import merge

    progress = ProgressBar()
    try:
        frame = merge(arguments.parts, arguments.output, progress)
    finally:
        progress.close()
    print(f"{arguments.output}: {len(arguments.parts)} parts, {frame.samples} samples, rendered in "
          f"{frame.seconds.get('render', 0.0):.1f} s in all")
