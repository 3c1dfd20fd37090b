"""``lfsr paper -o DIR --short``: every figure and table from nothing, and the one document that shows them."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from lfsr_core.commands.arguments import names

NAME = "paper"
HELP = "measure every study of the laboratory and draw one report of them, with a manifest"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR",
                        help="folder of everything; what is whole in it is not measured again. Machines may share it")
    how = parser.add_mutually_exclusive_group(required=True)
    how.add_argument("--short", action="store_true", help="every study on tiny frames: half an hour on two cores")
    how.add_argument("--long", action="store_true", help="as the documents quote it: days")
    how.add_argument("--draw", action="store_true", help="only draw again what is measured in DIR")
    parser.add_argument("--only", type=names, metavar="NAME,NAME", help="studies to measure; default: all")
    parser.add_argument("--part", type=_part, metavar="I/N", help="measure only every N-th unit, from the I-th on")
    parser.add_argument("--assets", type=Path, metavar="DIR", help="scenes of other people, named in document.toml")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")


def run(arguments: argparse.Namespace) -> None:
    """Measure what is missing, draw, and print the paths of manifest and report."""
    from lfsr_lab.experiments.document import run as document
    from lfsr_lab.experiments.document.studies import LONG, SHORT, read_table
    from lfsr_lab.experiments.document.work import Work
    from lfsr_lab.experiments.engine.environment import check_packages

    check_packages()
    table = read_table()
    work = Work(arguments.output, table, arguments.assets, arguments.blender)
    chosen = table.chosen(arguments.only)
    if not arguments.draw:
        document.measure(work, SHORT if arguments.short else LONG, chosen, arguments.part)
    for path in document.draw(work):
        print(path)


def _part(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    index, count = map(int, found.groups()) if found else (0, 0)
    if not 1 <= index <= count:
        raise argparse.ArgumentTypeError(f"{text!r} is not a part such as 2/3: which one, and how many there are")
    return index, count
