"""``lfsr export DIR --format NAME``: a finished frame for other displays, other programs, other people."""

from __future__ import annotations

import argparse
import os
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import ProgressBar
from lfsr_core.commands.sentences import sentence
from lfsr_core.exports.options import DESCRIPTIONS, FILM_TYPES, PRESETS, VIEW_TYPES

NAME = "export"
HELP = "write a finished frame or an animation as quilt, stereo pair, film or folder of views"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder, or an animation's folder")
    parser.add_argument("--format", required=True, choices=DESCRIPTIONS,
                        help="; ".join(f"{name}: {text}" for name, text in DESCRIPTIONS.items()))
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="default: DIR/export/FORMAT")
    parser.add_argument("--views", type=_pair, metavar="N|NxM",
                        help="cameras across and down, evenly over the viewing zone; default: all")
    parser.add_argument("--grid", type=_pair, metavar="CxR", help="tiles across and down of a quilt")
    parser.add_argument("--preset", choices=PRESETS,
                        help="tiles and size of a quilt that other programs know; default: that of the display's panel")
    parser.add_argument("--width", type=int, metavar="PX", help="of an image, or of a quilt's tile")
    parser.add_argument("--eyes-mm", type=float, metavar="MM", help="between two eyes, default: 63")
    parser.add_argument("--type", choices=sorted({*VIEW_TYPES, *FILM_TYPES}),
                        help="views: png or exr; sway: mp4, gif, webp or png; wiggle: gif, webp, mp4 or png; "
                             "quilt-film: mp4 or png")
    parser.add_argument("--fps", type=float, metavar="N", help="frames a second of a film; default of an animation: 24")
    parser.add_argument("--seconds", type=float, metavar="S", help="of a sway or wiggle to and fro, default: 4 or 0.8")


def run(arguments: argparse.Namespace) -> Any:
    """Write the export and print its path."""
    from lfsr_core.exports.formats import export
    from lfsr_core.exports.options import ExportOptions

    views, grid = arguments.views, arguments.grid
    if views and len(views) == 1:
        views = (views[0], 1 if arguments.format.startswith("quilt") else views[0])
    if grid and len(grid) == 1:
        grid = (grid[0], 1)
    with closing(ProgressBar(words=sentence)) as bar:
        options = ExportOptions(views, grid, arguments.preset, arguments.eyes_mm, arguments.width, arguments.type,
                                arguments.seconds, arguments.fps, bar)
        files = export(arguments.folder, arguments.format, arguments.output, options)
    print(files[0] if len(files) == 1 else f"{os.path.commonpath([file.parent for file in files])}: {len(files)} files")
    return {"files": files}


def _pair(text: str) -> tuple[int, ...]:
    try:
        numbers = tuple(int(part) for part in text.lower().split("x"))
        if len(numbers) not in (1, 2):
            raise ValueError
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not N or NxM, as 9 or 8x6") from None
    return numbers
