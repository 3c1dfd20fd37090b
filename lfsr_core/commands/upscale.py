"""``lfsr upscale DIR --method NAME``: the second stage only."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from lfsr_core.base.notices import Notice, Progress
from lfsr_core.base.progress import ProgressBar
from lfsr_core.commands.renamed import add_old_option
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.averaging import check_averaging
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, frame_folder, read_rendered

if TYPE_CHECKING:  # slow to import, and `lfsr --help` has to be quick
    from lfsr_core.frames.report import Report
    from lfsr_core.reconstruct.method_name import MethodName

NAME = "upscale"
HELP = "repeat the second stage of a rendered frame folder"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="frame folder of `lfsr render`")
    parser.add_argument("--frame", type=int, metavar="N", help="frame N of the animation in DIR")
    averaging = parser.add_argument(
        "--temporal-averaging", type=int, default=0, metavar="N",
        help="average with the N frames before and after it where nothing has changed; for an animation rendered with "
             "`lfsr render --temporal-averaging`")
    add_old_option(parser, "--share-frames", averaging)
    add_method_arguments(parser)


def add_method_arguments(parser: argparse.ArgumentParser) -> None:
    """Method and options of the second stage."""
    parser.add_argument("--method", metavar="NAME",
                        help="steps joined by +, as in denoise+bicubic; default: the most accurate")
    parser.add_argument("--dilate", type=int, default=0, metavar="N",
                        help="grow the foreground mask by N lenses, for details too thin for sparse views")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="weights for the method's denoiser or network")
    parser.add_argument("--step", type=int, metavar="N", help="elemental images per call of the method")
    parser.add_argument("--linear-exr", action=argparse.BooleanOptionalAction, default=False,
                        help="also write the scene-linear eia.exr")


def run(arguments: argparse.Namespace) -> None:
    """Upscale the folder and print the path of the image."""
    folder = arguments.folder if arguments.frame is None else frame_folder(arguments.folder, arguments.frame)
    check_averaging(arguments.temporal_averaging)
    frame = read_rendered(folder)
    method = (panel_method(arguments) if frame.panel_rays
              else chosen_method(arguments.method, frame.scale))
    upscale(folder, method, arguments)


def panel_method(arguments: argparse.Namespace) -> MethodName:
    """The given or default method for a direct subpixel render; LfsrError for a method that needs a light field."""
    from lfsr_core.reconstruct.method_name import PANEL_METHODS, MethodName
    from lfsr_core.reconstruct.methods import denoise
    from lfsr_core.reconstruct.subpixels import check_subpixels_finish

    name = arguments.method or PANEL_METHODS[0 if denoise.is_available() else -1]
    check_subpixels_finish(finish_of(name, arguments))
    return MethodName.parse(name)


def chosen_method(name: str | None, scale: int) -> MethodName:
    """What the method ``name``, or the default for None, does at ``scale``; LfsrError if it is unknown or cannot."""
    from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, PLAIN_METHOD
    from lfsr_core.reconstruct.methods import denoise
    from lfsr_core.reconstruct.registry import method as load_method

    if name is None:
        name = DEFAULT_METHOD if denoise.is_available() else PLAIN_METHOD
    chosen = load_method(name).name
    chosen.check_scale(scale)
    return chosen.at_scale(scale)


def finish_of(method: str, arguments: argparse.Namespace) -> Finish:
    """The method with the options of the second stage."""
    return Finish(method, arguments.dilate, str(arguments.weights) if arguments.weights else None,
                  arguments.linear_exr, arguments.temporal_averaging or 0)


def upscale(folder: Path, method: MethodName, arguments: argparse.Namespace) -> Report:
    """Run the second stage with a progress bar, print its times, and return its report."""
    from lfsr_core.pipeline.finishing import finish_frame

    with closing(ProgressBar()) as bar:
        def tell(told: Progress | Notice) -> None:
            if isinstance(told, Progress):
                bar(told.stage, told.fraction, told.detail)

        report = finish_frame(folder, finish_of(method.text, arguments), tell, step=arguments.step)
        frame = read_rendered(folder)
        for note in report.notes:
            if note not in frame.notes:  # the render has said those
                bar.note(sentence(note))
    times = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in report.seconds.items())
    if frame.panel_rays:
        print(f"{folder / PANEL_FILE}: the panel's image, traced for its subpixels; {method} ({times})")
        return report
    if frame.display.is_woven:
        print(f"{folder / PANEL_FILE}: the panel's image, woven for its lens sheet")
    print(f"{folder / EIA_FILE}: {method}, {report.foreground_fraction:.0%} of the lenses are foreground ({times})")
    return report
