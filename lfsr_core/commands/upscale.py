"""``lfsr upscale DIR --method NAME``: the second stage only."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import ProgressBar
from lfsr_core.commands import arguments as common
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.folder import FrameFolder

NAME = "upscale"
HELP = "repeat the second stage of a rendered frame folder"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="frame folder of `lfsr render`")
    parser.add_argument("--frame", type=int, metavar="N", help="frame N of the animation in DIR")
    parser.add_argument("--temporal-averaging", type=int, default=0, metavar="N",
                        help="average with the N frames before and after it where nothing has changed; for an "
                             "animation rendered with `lfsr render --temporal-averaging`")
    common.add_method_arguments(parser)


def run(arguments: argparse.Namespace) -> Any:
    """Upscale the folder and print the path of the image."""
    from lfsr_core.pipeline.make import finish_frame

    number, path = arguments.frame, arguments.folder
    folder = FrameFolder(path) if number is None else FrameFolder.of_frame(path, number)
    frame = folder.rendered
    finish = common.finish_of(arguments, bool(frame.subpixels), frame.scale)
    with closing(ProgressBar(words=sentence)) as bar:
        finish_frame(folder.path, finish, bar)
        show_finished(folder, bar)
    return {"folder": folder.path, "image": folder.image, "report": folder.report}


def show_finished(folder: FrameFolder, bar: ProgressBar) -> None:
    """Print what the second stage has to say, its times and its files."""
    report, frame = folder.report, folder.rendered
    for notice in report.notes:
        if notice not in frame.notes:  # the render has said those
            bar(notice)
    times = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in report.seconds.items())
    if frame.subpixels:
        print(f"{folder.image}: the panel's image, traced for its subpixels; {report.method} ({times})")
        return
    if frame.display.is_woven:
        print(f"{folder.path / 'panel.png'}: the panel's image, woven for its lens sheet")
    print(f"{folder.image}: {report.method}, {report.foreground_fraction:.0%} of the lenses are foreground ({times})")
