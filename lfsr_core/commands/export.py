"""``lfsr view``, ``views``, ``show``, ``export``, ``import``: show finished frames, and exchange them with programs."""

import argparse
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError, Notice, cleaned
from lfsr_core.commands.common import position, progress
from lfsr_core.exports.options import FORMATS, PRESETS, ExportOptions
from lfsr_core.process.child import OPENS


def export_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr export`."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder, or an animation's folder")
    parser.add_argument("--format", required=True, choices=FORMATS,
                        help="; ".join(f"{name}: {one.text}" for name, one in FORMATS.items()))
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="default: DIR/export/FORMAT")
    parser.add_argument("--views", type=_pair, metavar="N|NxM",
                        help="cameras across and down, evenly over the viewing zone; default: all")
    parser.add_argument("--grid", type=_pair, metavar="CxR", help="tiles across and down of a quilt")
    parser.add_argument("--preset", choices=PRESETS,
                        help="tiles and size of a quilt that other programs know; default: that of the display's panel")
    parser.add_argument("--width", type=int, metavar="PX", help="of an image, or of a quilt's tile")
    parser.add_argument("--eyes-mm", type=float, metavar="MM", help="between two eyes, default: 63")
    parser.add_argument("--type", choices=sorted({kind for one in FORMATS.values() for kind in one.types}),
                        help="views: png or exr; sway: mp4, gif, webp or png; wiggle: gif, webp, mp4 or png; "
                             "quilt-film: mp4 or png")
    parser.add_argument("--fps", type=float, metavar="N", help="frames a second of a film; default of an animation: 24")
    parser.add_argument("--seconds", type=float, metavar="S", help="of a sway or wiggle to and fro, default: 4 or 0.8")


def run_export(arguments: argparse.Namespace) -> Any:
    """Write the export and print its path."""
    from lfsr_core.exports.formats import export
    from lfsr_core.frames.folder import frame_folders
    from lfsr_core.frames.frame import read_frame

    views, grid = arguments.views, arguments.grid and (*arguments.grid, 1)[:2]
    if views and len(views) == 1:
        rows = read_frame(frame_folders(arguments.folder)[0]).display.views[1]
        views = (views[0], 1 if arguments.format.startswith("quilt") or rows == 1 else views[0])
    with progress() as bar:
        options = ExportOptions(views, grid, arguments.preset, arguments.eyes_mm, arguments.width, arguments.type,
                                arguments.seconds, arguments.fps, bar)
        files = export(arguments.folder, arguments.format, arguments.output, options)
    print(files[0] if len(files) == 1 else f"{os.path.commonpath([file.parent for file in files])}: {len(files)} files")
    return {"files": files}


def _pair(text: str) -> tuple[int, ...]:
    if not re.fullmatch(r"-?\d{1,9}(x-?\d{1,9})?", text, re.IGNORECASE):
        raise argparse.ArgumentTypeError(f"{text!r} is not N or NxM, as 9 or 8x6")
    return tuple(map(int, text.lower().split("x")))


def import_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr import`."""
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


def run_import(arguments: argparse.Namespace) -> Any:
    """Import; finish the frame if there is nothing to upscale; print the next command."""
    from lfsr_core.exports.importing import ImportGeometry, import_views, is_film, quilt_of
    from lfsr_core.optics.display import load_display
    from lfsr_core.reconstruct.second_stage import finish_frame

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
    with progress() as bar:
        display = import_views(source, folder, scale, geometry, bar, quilt)
        if scale == 1 and not film:
            finish_frame(folder, "none", bar)
    following = "view" if scale == 1 else "upscale"
    print(f"{folder}: {display.views[0]}×{display.views[1]} views of {display.lenses[0]}×{display.lenses[1]} pixels; "
          f"next: {shlex.join(['lfsr', following, str(folder)])}")
    return {"folder": folder, "display": display}


def view_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr view`."""
    parser.add_argument("folders", type=Path, nargs="+", metavar="DIR",
                        help="finished frame folder; several, or a folder of them, are an animation")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.html", help="default: view.html in the first DIR")
    parser.add_argument("--quality", type=int, metavar="1..100",
                        help="of the image in the page; 100 is lossless; default: 95, or 100 where 95 would be visible")
    parser.add_argument("--open", action="store_true", help="open it in the browser")


def run_view(arguments: argparse.Namespace) -> Any:
    """Write the page and print its path."""
    from lfsr_core.exports.page import write_page

    with progress() as bar:
        page = write_page(arguments.folders, arguments.output, arguments.quality, bar)
        print(f"{page.path}: {page.bytes / 1e6:.1f} MB, opens in a browser")
        if arguments.open and subprocess.call([sys.executable, "-c", OPENS, page.path.resolve().as_uri()]):
            bar(Notice("browser-missing"))
    return page


def views_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr views`."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("--eye", type=position, metavar="X,Y,Z",
                        help="millimetres from the display's centre, rightwards, upwards, towards the viewer; "
                             "negative X: --eye=-50,0,1000")


def run_views(arguments: argparse.Namespace) -> Any:
    """Write the images and print their paths."""
    from lfsr_core.exports.light_field import write_views

    files = write_views(arguments.folder, arguments.eye)
    print(*files, sep="\n")
    return {"files": files}


def show_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr show`."""
    parser.add_argument("path", type=Path, metavar="FRAME|FILM|QUILT",
                        help="frame folder, folder of them, quilt or film of quilts; or a panel's own image")
    parser.add_argument("--display", metavar="NAME|screen",
                        help="index or name of one of `lfsr displays --bridge`; screen: the panel's own image, full "
                             "screen in a browser; default: Bridge for lenticular displays, else screen")
    parser.add_argument("--fps", type=float, default=24.0, metavar="N",
                        help="frames a second of an animation, default: %(default)g")


def run_show(arguments: argparse.Namespace) -> Any:
    """Show it and say where."""
    from lfsr_core.exports.show import show

    with progress() as bar:
        shown = show(arguments.path, arguments.display, arguments.fps, bar)
        print(f"{shown.page}: {shown.sentence}" if shown.page else cleaned(shown.sentence))
        if shown.page and subprocess.call([sys.executable, "-c", OPENS, shown.page.resolve().as_uri()]):
            bar(Notice("browser-missing"))
    return shown
