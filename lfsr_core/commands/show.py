"""``lfsr show``: a finished image on a light-field display that is connected."""

from __future__ import annotations

import argparse
import webbrowser
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import Notice, ProgressBar
from lfsr_core.commands.sentences import sentence

NAME = "show"
HELP = "show a frame, an animation or a quilt on a display: through Looking Glass Bridge, or full screen in a browser"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("path", type=Path, metavar="FRAME|FILM|QUILT",
                        help="frame folder, folder of them, quilt or film of quilts; or a panel's own image")
    parser.add_argument("--display", metavar="NAME|screen",
                        help="index or name of one of `lfsr displays --bridge`; screen: the panel's own image, full "
                             "screen in a browser; default: Bridge for lenticular displays, else screen")
    parser.add_argument("--fps", type=float, default=24.0, metavar="N",
                        help="frames a second of an animation, default: %(default)g")


def run(arguments: argparse.Namespace) -> Any:
    """Show it and say where."""
    from lfsr_core.exports.show import show

    with closing(ProgressBar(words=sentence)) as bar:
        shown = show(arguments.path, arguments.display, arguments.fps, bar)
        print(f"{shown.page}: {shown.sentence}" if shown.page else shown.sentence)
        if shown.page and not webbrowser.open(shown.page.resolve().as_uri()):
            bar(Notice("browser-missing"))
    return shown
