"""``lfsr import SOURCE -o DIR``: light fields that others rendered or captured."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import ProgressBar
from lfsr_core.commands.sentences import sentence

NAME = "import"
HELP = "make a frame folder from a quilt or a folder of views (HCI, Stanford, JPEG Pleno), or several from a quilt film"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("source", type=Path, metavar="SOURCE", help="folder of views, or quilt: an image or a film")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR",
                        help="frame folder to write; of a film, the folder of its frame folders")
    parser.add_argument("--display", metavar="NAME|FILE.toml",
                        help="make the views for this display, and its panel image; default: one of their own size")
    parser.add_argument("--fill", action="store_true",
                        help="fill that display and cut the picture; default: all of it, between black bars")
    parser.add_argument("--quilt", metavar="CxR[aA]",
                        help="tiles across and down of a quilt, and the aspect ratio; default: as its name says")
    parser.add_argument("--top-first", action="store_true",
                        help="the quilt begins at the top left, as those for CubeVi's display; default: bottom left")
    parser.add_argument("--scale", type=int, default=1, metavar="N",
                        help="factor by which `lfsr upscale` multiplies the views along each axis; default: "
                             "%(default)s, which finishes the frame at once")
    parser.add_argument("--width-mm", type=float, metavar="MM", help="width of the plane without parallax")
    parser.add_argument("--distance-mm", type=float, metavar="MM", help="from the cameras to that plane")
    parser.add_argument("--angle-deg", type=float, metavar="DEG", help="over which the cameras are spread")
    parser.add_argument("--mirror", choices=("x", "y", "xy"), default="",
                        help="reverse the order of the cameras, if depth comes out inside out")


def run(arguments: argparse.Namespace) -> Any:
    """Import; finish the frame if there is nothing to upscale; print the next command."""
    from lfsr_core.exports.importing import ImportGeometry, import_film, import_quilt, import_views
    from lfsr_core.exports.sources import is_film, quilt_of
    from lfsr_core.optics.display import load_display
    from lfsr_core.pipeline.make import finish_frame

    source, folder, scale = arguments.source, arguments.output, arguments.scale
    target = load_display(arguments.display) if arguments.display else None
    geometry = ImportGeometry(arguments.width_mm, arguments.distance_mm, arguments.angle_deg, arguments.mirror, target,
                              arguments.fill)
    quilt = quilt_of(source, arguments.quilt, arguments.top_first) if source.is_file() else None
    if quilt is None and (arguments.quilt or arguments.top_first):
        raise LfsrError(f"{source} is no file, but --quilt and --top-first are for quilts: check the path, or leave "
                        "them out")
    film = quilt is not None and is_film(source)
    if film and scale != 1:
        raise LfsrError(f"scale is {scale}, but a film of quilts has all its views: leave it out")
    with closing(ProgressBar(words=sentence)) as bar:
        if quilt is None:
            display = import_views(source, folder, scale, geometry, bar)
        elif film:
            display = import_film(source, folder, quilt, geometry, bar)
        else:
            display = import_quilt(source, folder, quilt, scale, geometry, bar)
        if scale == 1 and not film:
            finish_frame(folder, "none")
    following = "view" if scale == 1 else "upscale"
    print(f"{folder}: {display.views[0]}×{display.views[1]} views of {display.lenses[0]}×{display.lenses[1]} pixels; "
          f"next: lfsr {following} {folder}")
    return {"folder": folder, "display": display}
