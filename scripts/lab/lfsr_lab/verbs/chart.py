"""``lfsr chart SCENES… -o DIR``: speed and accuracy of every method, measured end to end."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lfsr_core.commands.arguments import names, numbers
from lfsr_core.frames.request import check_scene

if TYPE_CHECKING:
    from lfsr_lab.experiments.chart.settings import Settings

NAME = "chart"
HELP = "measure every method's errors and end-to-end time on scenes, and draw both"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    parser.add_argument("-o", "--output", dest="folder", type=Path, required=True, metavar="DIR",
                        help="folder of the chart; complete cells in it are reused")
    parser.add_argument("--display", default="small", metavar="NAME|FILE.toml", help="default: %(default)s")
    parser.add_argument("--methods", type=names, metavar="NAME,NAME", help="default: every method there is")
    parser.add_argument("--ours", metavar="NAME", help="method that is held against the others; default: the default")
    _add_render_arguments(parser)
    _add_measure_arguments(parser)


def _add_render_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scale", type=int, default=4, metavar="2|3|4|5|8", help="default: %(default)s")
    parser.add_argument("--spps", type=_numbers, default=(1, 4, 16, 64), metavar="N,N",
                        help="samples per pixel of low-resolution renders, default: 1,4,16,64")
    parser.add_argument("--direct-spps", type=_numbers, default=(1, 4, 16), metavar="N,N",
                        help="samples of direct high-resolution renders, default: 1,4,16; `none` for none")
    parser.add_argument("--reference-spp", type=int, default=1024, metavar="N", help="default: %(default)s")
    parser.add_argument("--lenses", type=int, metavar="N", help="sampled reference of N lenses; default: all")
    parser.add_argument("--seeds", type=int, default=10, metavar="N",
                        help="renders of each, whose noise differs, default: %(default)s")
    parser.add_argument("--subject", metavar="COLLECTION", help="the foreground; default: everything but the world and "
                                                                "a collection called Background")
    parser.add_argument("--world-visible", action=argparse.BooleanOptionalAction,
                        help="show the world behind the subject; default: what each scene says")
    parser.add_argument("--device", default="CPU", metavar="NAME", help="Cycles device, default: %(default)s")
    parser.add_argument("--blender", metavar="PATH", help="Blender 4.5 or newer; default: the bpy package, then PATH")


def _add_measure_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--repeats", type=int, default=3, metavar="N",
                        help="timed runs of the second stage, default: %(default)s")
    parser.add_argument("--render-repeats", type=int, default=3, metavar="N",
                        help="renders that are made again for their time, default: %(default)s; 0: count all seeds")
    parser.add_argument("--times", action="store_true",
                        help="time renders and second stages that are not timed; without it nothing is timed")
    parser.add_argument("--only-measure", action="store_true", help="render nothing; leave out what is not there")


def run(arguments: argparse.Namespace) -> None:
    """Measure, write tables and charts, and print their paths."""
    from lfsr_lab.experiments.chart.run import run as run_chart
    from lfsr_lab.experiments.engine.environment import check_packages

    check_packages()
    settings = _settings(arguments)
    if not settings.only_measure:
        for scene in arguments.scenes:
            check_scene(scene)
    for path in run_chart(settings, arguments.scenes):
        print(path)


def _settings(arguments: argparse.Namespace) -> Settings:
    from lfsr_core.reconstruct.methods import DEFAULT_METHOD
    from lfsr_lab.experiments.chart.settings import DIRECT_METHODS, Settings, default_methods
    from lfsr_lab.networks.methods import LabMethod

    ours = arguments.ours or DEFAULT_METHOD
    methods = tuple(dict.fromkeys([ours, *(arguments.methods or default_methods())]))
    for name in methods:
        LabMethod.parse(name)
    given = {name: value for name, value in vars(arguments).items() if name in Settings.__dataclass_fields__}
    return Settings(**given | {"methods": methods, "direct_methods": DIRECT_METHODS, "ours": ours})


def _numbers(text: str) -> tuple[int, ...]:
    return () if text == "none" else numbers(text)
