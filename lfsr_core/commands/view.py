"""``lfsr view DIR``: a page that shows the finished EIA in any browser."""

from __future__ import annotations

import argparse
import webbrowser
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import ProgressBar
from lfsr_core.commands.sentences import sentence

NAME = "view"
HELP = "write one HTML file that shows finished EIAs as an eye in front of the display sees them"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folders", type=Path, nargs="+", metavar="DIR",
                        help="finished frame folder; several, or a folder of them, are an animation")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.html", help="default: view.html in the first DIR")
    parser.add_argument("--quality", type=int, metavar="1..100",
                        help="of the image in the page; 100 is lossless; default: 95, or 100 where 95 would be visible")
    parser.add_argument("--open", action="store_true", help="open it in the browser")


def run(arguments: argparse.Namespace) -> Any:
    """Write the page and print its path."""
    from lfsr_core.exports.page import write_page

    with closing(ProgressBar(words=sentence)) as bar:
        page = write_page(arguments.folders, arguments.output, arguments.quality, bar)
    print(f"{page.path}: {page.bytes / 1e6:.1f} MB, opens in a browser")
    if arguments.open:
        webbrowser.open(page.path.resolve().as_uri())
    return page
