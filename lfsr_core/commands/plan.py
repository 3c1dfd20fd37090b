"""``lfsr plan SCENE --target 0.95``: find the cheapest settings."""

from __future__ import annotations

import argparse
import shlex
from contextlib import closing
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import ProgressBar
from lfsr_core.commands.arguments import add_geometry_arguments, make_request, names, numbers, reals
from lfsr_core.frames.request import Sampling

NAME = "plan"
HELP = "find the cheapest scale, samples and method that reach an accuracy, from a small sample of lenses"
OPTIONS = ("target", "metric", "scales", "spps", "rays", "between", "methods", "most_seconds", "budget", "lenses",
           "reference_spp")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb; their defaults are those of ``PlanOptions``."""
    parser.add_argument("scene", type=Path, metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    parser.add_argument("--target", type=float, metavar="0..1", help="accuracy to reach, default: 0.95")
    parser.add_argument("--metric", metavar="NAME",
                        help="ssim_lens_fg (default) or ssim_lens, see docs/reference/metrics.md")
    parser.add_argument("--scales", type=numbers, metavar="N,N", help="default: those of 1,2,4,8 that the display has")
    parser.add_argument("--spps", type=numbers, metavar="N,N", help="samples per pixel, default: 4,16,64,256")
    parser.add_argument("--rays", type=reals, metavar="R,R", help="rays per finished pixel, instead of --spps")
    parser.add_argument("--between", type=int, metavar="N",
                        help="sample counts to estimate between each two of --spps, default: 3")
    parser.add_argument("--methods", type=names, metavar="NAME,NAME", help="default: the default method and its parts")
    parser.add_argument("--seconds", dest="most_seconds", type=float, metavar="N", help="longest time of a frame")
    parser.add_argument("--budget", type=float, metavar="0..1",
                        help="most that the sample may cost, as a fraction of the costliest candidate's frame, "
                             "default: 0.05; 100 million path samples are always allowed")
    parser.add_argument("--lenses", type=int, metavar="N",
                        help="number of lenses to sample, whatever the budget; default: 12 to 192, as many as it takes")
    parser.add_argument("--reference-spp", type=int, metavar="N", help="of the sampled lenses, default: 256")
    parser.add_argument("--details", action="store_true", help="show every measured candidate, not at most ten lines")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything that was measured")
    parser.add_argument("--work", type=Path, metavar="DIR", help="folder for the sample's renders, which a second plan "
                        "reuses; default: a cache that is removed when the plan is made")
    add_geometry_arguments(parser)


def run(arguments: argparse.Namespace) -> None:
    """Plan; print the table and the command that renders the choice."""
    from lfsr_core.base.records import write_record
    from lfsr_core.pipeline.store import run_job
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import make_plan
    from lfsr_core.plan.report import plan_report, table
    from lfsr_core.plan.work import work_folder
    from lfsr_core.process.blender import find_blender

    if arguments.rays is not None and arguments.spps is not None:
        raise LfsrError("--rays and --spps were both given: leave out one of them")
    given = {name: value for name in OPTIONS if (value := getattr(arguments, name)) is not None}
    options = PlanOptions(**given)
    job = make_request(arguments, output=".", sampling=Sampling(1, 1))
    blender = find_blender(arguments.blender)
    with closing(ProgressBar()) as bar, work_folder(arguments.work, job, options, bar.note) as folder:
        planned = make_plan(job, options, lambda job, progress: run_job(job, blender, progress, bar.note), folder, bar)
    print(table(planned, options, job.display, arguments.details))
    if arguments.json:
        write_record(arguments.json, plan_report(planned, options, job))
    if planned.choice.chosen is not None:
        print(render_command(arguments, planned.choice.chosen.options(job.display)))


def render_command(arguments: argparse.Namespace, options: tuple[str, ...]) -> str:
    """The `lfsr render` command line of a candidate's ``options`` for the scene that was planned."""
    words = ["lfsr", "render", str(arguments.scene), "-o", arguments.scene.stem, *options]
    usual = argparse.ArgumentParser(add_help=False)
    add_geometry_arguments(usual)
    for action in usual._actions:
        value = getattr(arguments, action.dest)
        if value == action.default:
            continue
        if isinstance(action, argparse.BooleanOptionalAction):
            words.append(action.option_strings[0 if value else 1])
        else:
            words += [action.option_strings[0], str(value)]
    return shlex.join(words)
