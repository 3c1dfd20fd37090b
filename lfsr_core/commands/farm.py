"""``lfsr farm NAME -o FILE``: job templates for render farms."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.pipeline.farms import TEMPLATES, write_template

NAME = "farm"
HELP = "write the job template of a render farm: openjd, or flamenco"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("farm", choices=TEMPLATES, help="openjd: a job template of Open Job Description; flamenco: a "
                                                        "job type of Flamenco 3")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE",
                        help="default: lfsr-openjd.yaml or lfsr-flamenco.js here")


def run(arguments: argparse.Namespace) -> Any:
    """Write the template and print its path."""
    name = TEMPLATES[arguments.farm]
    output = arguments.output or Path(f"lfsr-{name}")
    if output.is_dir():
        raise LfsrError(f"{output} is a folder, but the template is a file: give a file in it, as {output / name}")
    write_template(arguments.farm, output)
    print(f"{output}: see docs/guide/farms.md")
    return {"file": output}
