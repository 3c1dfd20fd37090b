"""``lfsr view``, ``lfsr views`` and ``lfsr show``: finished images in a browser, as files and on a display."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import Notice, cleaned
from lfsr_core.commands.common import position, progress
from lfsr_core.exports.light_field import write_views


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
    if arguments.open:
        webbrowser.open(page.path.resolve().as_uri())
    return page


def views_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr views`."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("--eye", type=position, metavar="X,Y,Z",
                        help="millimetres from the display's centre, rightwards, upwards, towards the viewer; "
                             "negative X: --eye=-50,0,1000")


def run_views(arguments: argparse.Namespace) -> Any:
    """Write the images and print their paths."""
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
        if shown.page and not webbrowser.open(shown.page.resolve().as_uri()):
            bar(Notice("browser-missing"))
    return shown
