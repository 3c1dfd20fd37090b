"""``lfsr views DIR``."""

from __future__ import annotations

import argparse
from pathlib import Path

from lfsr_core.frames.contact_sheet import write_views

NAME = "views"
FARTHEST_MM = 1e6
HELP = "write a contact sheet of decoded views, an EPI pair and what an eye would see"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("--eye", type=_position, metavar="X,Y,Z",
                        help="millimetres from the display's centre, rightwards, upwards, towards the viewer; "
                             "negative X: --eye=-50,0,1000")


def run(arguments: argparse.Namespace) -> None:
    """Write the pictures and name them."""
    for path in write_views(arguments.folder, arguments.eye):
        print(path)


def _position(text: str) -> tuple[float, float, float]:
    parts = text.split(",")
    try:
        x, y, z = (float(part) for part in parts)
        if not all(abs(value) <= FARTHEST_MM for value in (x, y, z)):
            raise ValueError
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not three numbers X,Y,Z in millimetres, "
                                         f"each below {FARTHEST_MM:g}") from None
    return x, y, z
