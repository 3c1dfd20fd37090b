"""``lfsr upscale DIR --method NAME``: the second stage only."""

from __future__ import annotations

import argparse
import os
from contextlib import closing
from pathlib import Path

from lfsr_core.base.progress import ProgressBar
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.reconstruct.methods import METHODS

NAME = "upscale"
HELP = "repeat the second stage of a rendered frame folder"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="frame folder of `lfsr render`")
    parser.add_argument("--frame", type=int, metavar="N", help="frame N of the animation in DIR")
    parser.add_argument("--temporal-averaging", type=int, default=0, metavar="N",
                        help="average with the N frames before and after it where nothing has changed; for an "
                             "animation rendered with `lfsr render --temporal-averaging`")
    add_method_arguments(parser)


def add_method_arguments(parser: argparse.ArgumentParser) -> None:
    """Method and options of the second stage."""
    parser.add_argument("--method", metavar="NAME",
                        help=f"steps of {', '.join(METHODS)}, joined by + as in denoise+bicubic; default: the most "
                             "accurate")
    parser.add_argument("--dilate", type=int, default=0, metavar="N",
                        help="grow the foreground mask by N lenses, for details too thin for sparse views")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="weights for the method's denoiser")
    parser.add_argument("--linear-exr", action=argparse.BooleanOptionalAction, default=False,
                        help="also write the scene-linear eia.exr")


def run(arguments: argparse.Namespace) -> None:
    """Upscale the folder and print the path of the image."""
    from lfsr_core.pipeline.finishing import finish_frame

    number, path = arguments.frame, arguments.folder
    folder = FrameFolder(path) if number is None else FrameFolder.of_frame(path, number)
    frame = folder.rendered
    finish = finish_of(arguments, bool(frame.subpixels), frame.scale)
    with closing(ProgressBar(words=sentence)) as bar:
        finish_frame(folder.path, finish, bar)
        show_finished(folder, bar)


def method_of(name: str | None, is_direct: bool) -> str:
    """Return the ``name`` of the method asked for, else that of the best that this machine can do.

    ``is_direct``: whether the panel's subpixels are rendered.
    """
    from lfsr_core.reconstruct.methods import DEFAULT_METHOD, PLAIN_METHOD, SUBPIXEL_METHODS, denoise

    best, plain = SUBPIXEL_METHODS if is_direct else (DEFAULT_METHOD, PLAIN_METHOD)
    return name or (best if denoise.is_available() else plain)


def finish_of(arguments: argparse.Namespace, is_direct: bool, scale: int) -> Finish:
    """Return the finish that the arguments ask for; LfsrError for a method that cannot finish a render at ``scale``."""
    from lfsr_core.reconstruct.methods import load_method
    from lfsr_core.reconstruct.subpixels import check_subpixels_finish

    name = method_of(arguments.method, is_direct)
    finish = Finish(name, arguments.dilate, os.path.abspath(arguments.weights) if arguments.weights else None,
                    arguments.linear_exr, arguments.temporal_averaging or 0)
    chosen = load_method(name).name
    if is_direct:
        check_subpixels_finish(finish)
    else:
        chosen.check_scale(scale)
    return finish


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
