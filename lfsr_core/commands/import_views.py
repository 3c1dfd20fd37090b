"""``lfsr import FOLDER -o DIR``: light fields that others rendered or captured."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path

from lfsr_core.progress import ProgressBar

NAME = "import"
HELP = "make a frame folder from a folder of views: HCI, Stanford, JPEG Pleno"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("source", type=Path, metavar="FOLDER", help="folder of views")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")
    parser.add_argument("--scale", type=int, default=1, metavar="N",
                        help="factor by which `lfsr upscale` multiplies the views along each axis; default: "
                             "%(default)s, which finishes the frame at once")
    parser.add_argument("--width-mm", type=float, metavar="MM", help="width of the plane without parallax")
    parser.add_argument("--distance-mm", type=float, metavar="MM", help="from the cameras to that plane")
    parser.add_argument("--angle-deg", type=float, metavar="DEG", help="over which the cameras are spread")
    parser.add_argument("--mirror", choices=("x", "y", "xy"), default="",
                        help="reverse the order of the cameras, if depth comes out inside out")


def run(arguments: argparse.Namespace) -> None:
    """Import; finish the frame if there is nothing to upscale; print the next command."""
    from lfsr_core.exports.importing import ImportGeometry, import_views
    from lfsr_core.reconstruct.second_stage import upscale_frame

    folder = arguments.output
    geometry = ImportGeometry(arguments.width_mm, arguments.distance_mm, arguments.angle_deg, arguments.mirror)
    with closing(ProgressBar()) as bar:
        imported = import_views(arguments.source, folder, arguments.scale, geometry, bar)
        if arguments.scale == 1:
            upscale_frame(folder, "none")
        for note in imported.notes:
            bar.note(note)
    display, following = imported.display, "view" if arguments.scale == 1 else "upscale"
    print(f"{folder}: {display.views[0]}×{display.views[1]} views of {display.lenses[0]}×{display.lenses[1]} pixels; "
          f"next: lfsr {following} {folder}")
