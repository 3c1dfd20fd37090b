"""``lfsr render SCENE -o DIR``: from a scene to the finished EIA."""

from __future__ import annotations

import argparse

from lfsr_core.commands import upscale
from lfsr_core.commands.arguments import add_rows_argument, add_scene_arguments, make_job, render
from lfsr_core.frames.foreground import check_dilate
from lfsr_core.frames.job import LAYERS
from lfsr_core.optics.lens_rows import shown

NAME = "render"
HELP = "render a scene's low-resolution EIA with Blender and upscale it to eia.png"
DEFAULT_SAMPLES = 16


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    add_scene_arguments(parser, DEFAULT_SAMPLES)
    parser.add_argument("--scale", type=int, default=4, metavar="2|3|4|5|8",
                        help="views are divided by it for the render, default: %(default)s; "
                             "1 renders every view (with --method oidn or none)")
    parser.add_argument("--layers", type=_layers, metavar="NAME,NAME",
                        help=f"auxiliary layers from the same render, of {', '.join(LAYERS)}, "
                             "or `none`; default: those that the method looks at")
    add_rows_argument(parser)
    upscale.add_method_arguments(parser)


def run(arguments: argparse.Namespace) -> None:
    """Render, then upscale; a bad method is refused before any time is spent on rendering."""
    check_dilate(arguments.dilate)
    method = upscale.chosen_method(arguments.method, arguments.scale)
    layers = method.layers if arguments.layers is None else arguments.layers
    job = make_job(arguments, scale=arguments.scale, layers=layers)
    render(arguments, job)
    if job.rows is not None:
        print(f"{arguments.output}: rows {shown(job.rows)} of {job.display.lenses[1]}; join the parts by `lfsr merge`")
        return
    upscale.upscale(arguments.output, method, arguments)


def _layers(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    return () if names == ("none",) else names


