"""``lfsr render SCENE -o DIR``: from a scene to the finished EIA, of one frame or of an animation."""

from __future__ import annotations

import argparse
import dataclasses
import os
import time
from collections.abc import Sequence
from contextlib import closing
from typing import TYPE_CHECKING

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import ProgressBar
from lfsr_core.commands import arguments as common
from lfsr_core.commands import upscale
from lfsr_core.commands.renamed import add_old_option
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.averaging import check_averaging, seed_in_turn
from lfsr_core.frames.foreground import check_dilate
from lfsr_core.frames.frame import SUBPIXELS, read_frame
from lfsr_core.frames.numbers import parse_frames, spread
from lfsr_core.frames.report import Report, read_report
from lfsr_core.frames.request import LAYERS, Request, Sampling
from lfsr_core.optics.depth_scale import USUAL_SAMPLES, USUAL_SCALE, samples_at, scales_up_to, usual_rays
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.lens_rows import rows_text
from lfsr_core.pipeline.store import with_blender

if TYPE_CHECKING:
    from lfsr_core.reconstruct.method_name import MethodName

NAME = "render"
HELP = "render a scene's low-resolution EIA with Blender and upscale it to eia.png"
AUTO_SCALE = "auto"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    common.add_scene_arguments(parser)
    parser.add_argument("--rays", type=float, metavar="R",
                        help="rays per finished pixel, which decide noise and time: 1 is 16 samples per rendered pixel "
                             f"at scale 4 and 4 at scale 2; default: as many as {USUAL_SAMPLES} samples at scale "
                             f"{USUAL_SCALE}; with --layout {SUBPIXELS}: {USUAL_SAMPLES}")
    parser.add_argument("--spp", type=int, metavar="N",
                        help="samples per rendered pixel whatever the scale, instead of --rays")
    parser.add_argument("--scale", type=_scale, default=AUTO_SCALE, metavar="auto|1|2|3|4|5|8",
                        help="factor by which the views are divided for the render, 1 for every view; auto, the "
                             "default: the one up to 5 that loses least at the scene's depth and the rays")
    parser.add_argument("--scale-frames", metavar="A-B|A-BxN|A,B,C",
                        help="with --scale auto, frames whose depth decides one scale for all of them; default: those "
                             "of --frames, else the frame that is rendered")
    parser.add_argument("--layers", type=_layers, default=(), metavar="NAME,NAME",
                        help=f"auxiliary layers from the same render, of {', '.join(LAYERS)}")
    common.add_rows_argument(parser)
    parser.add_argument("--frames", metavar="A-B|A-BxN|A,B,C",
                        help="an animation: frames A to B, every Nth, or a list, each in a folder of DIR such as 0001; "
                             "finished frames are not rendered again")
    parser.add_argument("--overwrite", action="store_true", help="with --frames, render finished frames again")
    parser.add_argument("--allow-empty", action="store_true",
                        help="exit with 0 although no lens sees the subject, with --frames in no frame")
    common.add_cluster_arguments(parser, "with --frames, ")
    averaging = parser.add_argument(
        "--temporal-averaging", type=int, metavar="N",
        help="average each frame of an animation with the N frames before and after it where nothing has changed, and "
             "give each frame noise of its own; 2 is a good value. With --frame: with the frames already in DIR")
    add_old_option(parser, "--share-frames", averaging)
    upscale.add_method_arguments(parser)


def run(arguments: argparse.Namespace) -> None:
    """Check the method, render, then upscale."""
    check_dilate(arguments.dilate)
    _check_together(arguments)
    display = load_display(arguments.display)
    scales = _scales(arguments, display)
    method = (upscale.panel_method(arguments) if arguments.layout == SUBPIXELS
              else upscale.chosen_method(arguments.method, scales[0]))
    scales = method.scales_of(scales) if arguments.scale == AUTO_SCALE else scales
    job = common.make_request(arguments, layers=arguments.layers, sampling=_sampling(arguments, display, scales))
    if arguments.frames is not None:
        _render_frames(arguments, job, method)
        return
    if arguments.temporal_averaging is not None:
        check_averaging(arguments.temporal_averaging)
        job = dataclasses.replace(job, seed=seed_in_turn(job.seed, arguments.frame, arguments.temporal_averaging))
    with_blender(arguments.blender, announce=False)(job)
    if job.rows is not None:
        print(f"{arguments.output}: rows {rows_text(job.rows)} of {job.display.lenses[1]}; join the parts with "
              "`lfsr merge`")
        return
    if job.sampling.scales:
        method = method.at_scale(read_frame(arguments.output).scale)
    report = upscale.upscale(arguments.output, method, arguments)
    _check_seen(arguments, [report])


def _scales(arguments: argparse.Namespace, display: DisplayProfile) -> tuple[int, ...]:
    """The scale asked for, or those that the depth of the scene chooses from, the largest first."""
    if arguments.scale != AUTO_SCALE:
        return (int(arguments.scale),)
    return (1,) if arguments.layout == SUBPIXELS else scales_up_to(display)


def _sampling(arguments: argparse.Namespace, display: DisplayProfile, scales: tuple[int, ...]) -> Sampling:
    """Scale and samples, or scales and rays from which both follow."""
    usual = USUAL_SAMPLES if arguments.layout == SUBPIXELS else usual_rays(display)
    rays = None if arguments.spp is not None else usual if arguments.rays is None else arguments.rays
    samples = arguments.spp if rays is None else samples_at(display, scales[0], rays)
    if len(scales) == 1:
        return Sampling(scales[0], samples)
    frames = spread(parse_frames(arguments.scale_frames)) if arguments.scale_frames else ()
    return Sampling(scales[0], samples, scales, rays, frames)


def _render_frames(arguments: argparse.Namespace, job: Request, method: MethodName) -> None:
    from lfsr_core.pipeline.animation import SecondStage, animation_of, kept_scale
    from lfsr_core.pipeline.cluster_animation import render_on
    from lfsr_core.pipeline.engine import FAILED, Tools, counts, render_animation, table

    cluster = common.chosen_cluster(arguments)
    # Workers start in folders of their own.
    job = dataclasses.replace(job, output=os.path.abspath(job.output))
    job = job if arguments.overwrite else kept_scale(job)
    weights = os.path.abspath(arguments.weights) if arguments.weights else None
    second = SecondStage(str(method), arguments.dilate, weights, arguments.step, arguments.linear_exr,
                         arguments.temporal_averaging or 0)
    animation = animation_of(job, parse_frames(arguments.frames), second)
    started = time.monotonic()
    with closing(ProgressBar()) as bar:
        tools = Tools(arguments.blender, bar, bar.note, overwrite=arguments.overwrite)
        results = render_on(cluster, animation, tools) if cluster else render_animation(animation, tools)
    print(f"{table(results)}\n{counts(results, time.monotonic() - started)}")
    failed = [result for result in results if result.state == FAILED]
    if failed:
        raise LfsrError(f"{len(failed)} of {len(results)} frames failed, first frame {failed[0].frame} "
                        f"({failed[0].error}): run the same command again to render them")
    _check_seen(arguments, [read_report(result.folder) for result in results])


def _check_seen(arguments: argparse.Namespace, reports: Sequence[Report]) -> None:
    """LfsrError where no image shows any of the subject, unless that is allowed."""
    said = [[note for note in report.notes if note.code == "subject-unseen"] for report in reports]
    if arguments.allow_empty or not all(said):
        return
    raise LfsrError(f"{sentence(said[0][0])}. Turn the camera, choose another --camera or --subject, or keep the image "
                    f"in {arguments.output} with --allow-empty")


def _check_together(arguments: argparse.Namespace) -> None:
    """LfsrError for options that exclude each other, or that need --frames."""
    others = {"--frame": arguments.frame, "--rows": arguments.rows}
    alone = {"--overwrite": arguments.overwrite or None, "--workers": arguments.workers, "--cluster": arguments.cluster,
             "--temporal-averaging": arguments.temporal_averaging if arguments.frame is None else None}
    for name, value in (alone if arguments.frames is None else others).items():
        if value is not None:
            raise LfsrError(f"{name} was given without --frames: give the frames, as in --frames 1-48"
                            if arguments.frames is None else
                            f"--frames {arguments.frames} and {name} were both given: leave out one of them")
    if arguments.rays is not None and arguments.spp is not None:
        raise LfsrError(f"--rays {arguments.rays:g} and --spp {arguments.spp} were both given: leave out one of them")


def _scale(text: str) -> int | str:
    try:
        return text if text == AUTO_SCALE else int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a whole number nor {AUTO_SCALE!r}") from None


def _layers(text: str) -> tuple[str, ...]:
    return () if text.strip() == "none" else common.names(text)
