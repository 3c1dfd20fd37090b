"""``lfsr farm NAME -o FILE``: what a render farm needs to know of our jobs."""

from __future__ import annotations

import argparse
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path

NAME = "farm"
HELP = "write the job template of a render farm: openjd, or flamenco"
TEMPLATES = {"openjd": "openjd.yaml", "flamenco": "flamenco.js"}
FOLDER = Path(__file__).parents[1] / "sequence" / "templates"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("farm", choices=TEMPLATES, help="openjd: a job template of Open Job Description; flamenco: a "
                                                        "job type of Flamenco 3")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE",
                        help="default: lfsr-openjd.yaml or lfsr-flamenco.js here")


def run(arguments: argparse.Namespace) -> None:
    """Write the template and say where it is."""
    name = TEMPLATES[arguments.farm]
    output = arguments.output or Path(f"lfsr-{name}")
    if output.is_dir():
        raise LfsrError(f"{output} is a folder, but the template is a file: name one in it, as {output / name}")
    with atomic_path(output) as temporary:
        temporary.write_bytes((FOLDER / name).read_bytes())
    print(f"{output}: see docs/guide/farms.md")
