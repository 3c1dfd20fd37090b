"""``lfsr views DIR``: images for judging a finished frame."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lfsr_core.commands.arguments import position
from lfsr_core.frames.views import write_views

NAME = "views"
HELP = "write a contact sheet of decoded views, a pair of EPIs, and what an eye would see"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("--eye", type=position, metavar="X,Y,Z",
                        help="millimetres from the display's centre, rightwards, upwards, towards the viewer; "
                             "negative X: --eye=-50,0,1000")


def run(arguments: argparse.Namespace) -> Any:
    """Write the images and print their paths."""
    files = write_views(arguments.folder, arguments.eye)
    print(*files, sep="\n")
    return {"files": files}
