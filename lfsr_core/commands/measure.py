"""``lfsr reference``, ``compare`` and ``plan``: references in two halves, metrics, and the cheapest settings."""

from __future__ import annotations

import argparse
import dataclasses
import functools
import math
import os
import shlex
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.base.messages import LfsrError
from lfsr_core.commands import common
from lfsr_core.commands.common import add_geometry_arguments, add_scene_arguments, make_request, names, numbers
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS, Sampling
from lfsr_core.optics.rays import check_count, choose_lenses

if TYPE_CHECKING:
    from lfsr_core.metrics.eia_metrics import Metrics
    from lfsr_core.optics.display import DisplayProfile
    from lfsr_core.plan.options import Candidate, Rated
    from lfsr_core.plan.planner import Planned

OPTIONS = ("target", "metric", "scales", "samples", "rays", "methods", "most_seconds", "budget", "lenses",
           "reference_samples")
MOST_ROWS = 5  # so that heading, rows, cost, sentence and command are ten lines
HEADINGS = ("", "scale", "rays", "spp", "method", "seconds", "accuracy", "95 % above", "")


def reference_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr reference`."""
    add_scene_arguments(parser)
    parser.add_argument("--spp", type=int, default=1024, metavar="N", help="samples per pixel, default: %(default)s")
    parser.add_argument("--lenses", type=int, metavar="N",
                        help="only N random lenses, spread over the foreground; default: all")


def run_reference(arguments: argparse.Namespace) -> Any:
    """Choose lenses if asked to; render them at full resolution, unclamped."""
    from lfsr_core.images.image_files import read_layers
    from lfsr_core.pipeline.make import make
    from lfsr_core.reconstruct.upscaler import foreground_mask

    if arguments.layout == SUBPIXELS:
        raise LfsrError(f"a reference is a light field, but the layout {SUBPIXELS} renders none: choose another layout")
    for first, second in (("rows", "cluster"), ("lenses", "rows")):
        if None not in (getattr(arguments, first), getattr(arguments, second)):
            raise LfsrError(f"--{first} {getattr(arguments, first)} and --{second} {getattr(arguments, second)} were "
                            "both given: leave out one of them")
    request = make_request(arguments, kind="reference", sampling=Sampling(1, arguments.spp), clamp_indirect=0.0)
    display = request.display
    with common.progress() as bar:
        if arguments.lenses is not None:
            check_count(arguments.lenses, math.prod(display.lenses))
            print(f"choosing {arguments.lenses} lenses from a quick render", file=sys.stderr)
            scale = min(display.scales(), key=lambda scale: abs(scale - 4), default=1)
            with tempfile.TemporaryDirectory() as name:
                quick = dataclasses.replace(request, kind="render", output=str(Path(name, "mask")),
                                            sampling=Sampling(scale, 4))
                make(quick, blender=arguments.blender, tell=bar)
                mask = foreground_mask(read_layers(Path(quick.output, LOW_RES_FILE)), display.lenses)
            request = dataclasses.replace(request, lens_list=choose_lenses(mask, arguments.lenses, arguments.seed))
        if arguments.cluster is None:
            make(request, blender=arguments.blender, tell=bar, overwrite=True)
        else:
            from lfsr_core.pipeline.cluster import reference_on

            # Workers start in folders of their own.
            reference_on(arguments.cluster, dataclasses.replace(request, output=os.path.abspath(request.output)),
                         arguments.blender, bar)
    rows = request.rows
    count = (display.lenses[0] * (rows[1] - rows[0] + 1) if rows is not None else
             len(request.lens_list) if request.lens_list else math.prod(display.lenses))
    halves = sorted({request.sampling.samples // 2, (request.sampling.samples + 1) // 2})
    print(f"{arguments.output}: {count} lenses, two halves of {' and '.join(map(str, halves))} samples")
    return {"folder": arguments.output, "lenses": count, "samples": request.sampling.samples}


def compare_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr compare`."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("reference", type=Path, metavar="REFDIR", help="folder of `lfsr reference`")


def run_compare(arguments: argparse.Namespace) -> Any:
    """Compare and print."""
    from lfsr_core.metrics.eia_metrics import compare_folders

    metrics = compare_folders(arguments.folder, arguments.reference)
    print("\n".join(metrics_table(metrics)))
    return metrics


def metrics_table(metrics: Metrics) -> list[str]:
    """One line per known metric (value, 95 % interval of a sample of lenses, meaning), then one per note."""
    spread = {name: f" ± {half_width:.4f}" for name, half_width in metrics.ci95.items() if half_width is not None}
    lines = [f"{field.name:17} {value:8.4f}{spread.get(field.name, ''):10}  {field.metadata['meaning']}"
             for field in dataclasses.fields(metrics) if field.metadata
             and (value := getattr(metrics, field.name)) is not None]
    return [*lines, *map(sentence, metrics.notes)]


def plan_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr plan`; ``PlanOptions`` has the defaults."""
    parser.add_argument("scene", type=Path, metavar="SCENE", help=".blend, .glb, .gltf or .obj")
    parser.add_argument("--target", type=float, metavar="0..1", help="accuracy to reach, default: 0.95")
    parser.add_argument("--metric", metavar="NAME", help="ssim_lens_fg (default) or ssim_lens")
    parser.add_argument("--scales", type=numbers, metavar="N,N", help="default: those of 1,2,4,8 that the display has")
    parser.add_argument("--spps", dest="samples", type=numbers, metavar="N,N",
                        help="samples per pixel, default: 4,16,64,256")
    parser.add_argument("--rays", type=functools.partial(numbers, kind=float), metavar="R,R",
                        help="rays per finished pixel, instead of --spps")
    parser.add_argument("--methods", type=names, metavar="NAME,NAME", help="default: the default method and its parts")
    parser.add_argument("--seconds", dest="most_seconds", type=float, metavar="N", help="longest time of a frame")
    parser.add_argument("--budget", type=float, metavar="0..1",
                        help="most that the sample may cost, as a fraction of the costliest candidate's frame, "
                             "default: 0.02; 10 million path samples are always allowed")
    parser.add_argument("--lenses", type=int, metavar="N",
                        help="number of lenses to sample, whatever the budget; default: 48, or what the budget "
                        "allows, at least 24")
    parser.add_argument("--reference-spp", dest="reference_samples", type=int, metavar="N",
                        help="of the sampled lenses, default: 128")
    parser.add_argument("--details", action="store_true", help="show every measured candidate, not at most ten lines")
    parser.add_argument("--work", type=Path, metavar="DIR", help="folder for the sample's renders, which a second plan "
                        "reuses; default: a cache that is removed when the plan is made")
    add_geometry_arguments(parser)


def run_plan(arguments: argparse.Namespace) -> Any:
    """Plan; print the table and the command that renders the choice."""
    from lfsr_core.pipeline.make import open_blender
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import make_plan, work_folder
    from lfsr_core.process.child import find_blender

    if arguments.rays is not None and arguments.samples is not None:
        raise LfsrError("--rays and --spps were both given: leave out one of them")
    options = PlanOptions(**{name: value for name in OPTIONS if (value := getattr(arguments, name)) is not None})
    request = make_request(arguments, output=".", sampling=Sampling(1, 1))
    with (common.progress() as bar, work_folder(arguments.work, request, options, bar) as folder,
          open_blender(find_blender(arguments.blender), folder) as render):
        planned = make_plan(request, options, render, folder, bar)
    print(table(planned, request.display, arguments.details))
    if planned.choice.chosen is not None:
        print(render_command(arguments, planned.choice.chosen, request.display))
    return planned


def table(planned: Planned, display: DisplayProfile, details: bool) -> str:
    """Table of the measured candidates and the chosen one, cheapest first; the cost of the sample; the choice.

    Without ``details`` at most ten lines: candidates as accurate as a cheaper one are left out.
    """
    choice, sample, shown = planned.choice, planned.sample, list(planned.candidates)
    if not details:
        best, front = -math.inf, []
        for row in shown:
            if row.low > best or row == choice.chosen:
                best = max(best, row.low)
                front.append(row)
        last = next((place for place, row in enumerate(front) if row == (choice.chosen or choice.best)), len(front) - 1)
        shown = front[:last + 2][-MOST_ROWS:]
    rows = [HEADINGS]
    for row in shown:
        measured = ("–", "–") if row.estimate is None else (f"{row.estimate.mean:.3f}", f"{row.low:.3f}")
        note = sentence(row.unmeasured) if row.unmeasured else "reaches it" * (row.low >= planned.options.target)
        rows.append(("→" * (row == choice.chosen), str(row.scale), f"{row.rays(display):.3g}", str(row.samples),
                     row.method, f"{row.seconds:.1f}", *measured, note))
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    seconds = sample.seconds + sample.measuring_seconds
    cost = (f"sampled {sample.lenses} lenses in {seconds:.0f} s: {sample.fraction:.1%} of the path samples of "
            f"{sample.costliest}, {seconds / sample.costliest_seconds:.1%} of its {sample.costliest_seconds:.0f} s")

    def accuracy(row: Rated) -> str:
        return "not measured" if row.estimate is None else f"{row.estimate.mean:.3f}, at least {row.low:.3f}"

    target = f"{planned.options.metric} {planned.options.target:g}"
    if choice.chosen is not None:
        answer = (f"{choice.chosen.name} reaches {target} with 95 % confidence ({accuracy(choice.chosen)}) in about "
                  f"{choice.chosen.seconds:.0f} s")
    else:
        limit = sentence(choice.limit) if choice.limit else ""
        answer = f"nothing reaches {target}: {limit}" if choice.best is None else (
            f"nothing reaches {target} with 95 % confidence; best is {choice.best.name} ({accuracy(choice.best)}). "
            f"Limit: {limit}")
    return "\n".join([*lines, "", cost, answer])


def render_command(arguments: argparse.Namespace, chosen: Candidate, display: DisplayProfile) -> str:
    """The `lfsr render` command line of a candidate for the scene that was planned."""
    words = ["lfsr", "render", str(arguments.scene), "-o", arguments.scene.stem, "--scale", str(chosen.scale),
             "--rays", f"{chosen.rays(display):.6g}", "--method", chosen.method]
    usual = argparse.ArgumentParser(add_help=False)
    add_geometry_arguments(usual)
    for action in usual._actions:
        if (value := getattr(arguments, action.dest)) == action.default:
            continue
        if isinstance(action, argparse.BooleanOptionalAction):
            words.append(action.option_strings[0 if value else 1])
        elif value is True:
            words.append(action.option_strings[0])
        else:
            words += [action.option_strings[0], str(value)]
    return shlex.join(words)
