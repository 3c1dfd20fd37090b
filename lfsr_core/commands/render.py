"""``lfsr render``, ``upscale``, ``farm`` and ``merge``: from a scene to finished EIAs, here or on several machines."""

import argparse
import dataclasses
import math
import os
import shlex
import time
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError, duration
from lfsr_core.commands import common
from lfsr_core.commands.common import ProgressBar, progress
from lfsr_core.commands.measure import metrics_table
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames import frame as files
from lfsr_core.frames.folder import FrameFolder, numbered
from lfsr_core.frames.frame import Sampling, parse_frames, scales_up_to, spread
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import check_count, rows_text
from lfsr_core.pipeline.farms import NEXT, TEMPLATES, write_template

AUTO_SCALE, CHECK_SAMPLES = "auto", 1024


def render_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr render`."""
    common.add_scene_arguments(parser, "with --frames, ")
    parser.add_argument("--rays", type=float, metavar="R",
                        help="rays per finished pixel, which decide noise and time: 1 is 16 samples per rendered pixel "
                             f"at scale 4 and 4 at scale 2; default: as many as {files.USUAL_SAMPLES} samples at scale "
                             f"{files.USUAL_SCALE}; with --layout {files.SUBPIXELS}: {files.USUAL_SAMPLES}")
    parser.add_argument("--spp", type=int, metavar="N",
                        help="samples per rendered pixel whatever the scale, instead of --rays")
    parser.add_argument("--scale", type=_scale, default=AUTO_SCALE, metavar="auto|1|2|3|4|5|8",
                        help="factor by which the views are divided for the render, 1 for every view; auto, the "
                             "default: the one up to 5 that loses least at the scene's depth and the rays")
    parser.add_argument("--scale-frames", metavar="A-B|A-BxN|A,B,C",
                        help="with --scale auto, frames whose depth decides one scale for all of them; default: those "
                             "of --frames, else the frame that is rendered")
    parser.add_argument("--layers", type=lambda text: common.names("" if text == "none" else text), default=(),
                        metavar="NAME,NAME", help=f"auxiliary layers of the same render, of {', '.join(files.LAYERS)}")
    parser.add_argument("--frames", metavar="A-B|A-BxN|A,B,C",
                        help="an animation: frames A to B, every Nth, or a list, each in a folder of DIR such as 0001; "
                             "finished frames are not rendered again")
    parser.add_argument("--overwrite", action="store_true", help="with --frames, render finished frames again")
    parser.add_argument("--allow-empty", action="store_true",
                        help="exit with 0 although no lens sees the subject, with --frames in no frame")
    parser.add_argument("--temporal-averaging", type=int, metavar="N",
                        help="average each frame of an animation with the N frames before and after it where nothing "
                             "has changed, and give each frame noise of its own; 2 is a good value. With --frame: with "
                             "the frames already in DIR")
    parser.add_argument("--check", type=int, metavar="N",
                        help="then path-trace every view of N random lenses, in DIR_reference, and put SSIM with its "
                             "95 %% interval, from 8 lenses on, into the report")
    common.add_method_arguments(parser)


def run_render(arguments: argparse.Namespace) -> Any:
    """Make one image or an animation, and print what was made."""
    from lfsr_core.pipeline.make import FAILED, make
    from lfsr_core.reconstruct.methods import MethodName

    # Options that exclude each other, or that need --frames.
    others = {"--frame": arguments.frame, "--rows": arguments.rows}
    alone = {"--overwrite": arguments.overwrite or None, "--cluster": arguments.cluster,
             "--temporal-averaging": arguments.temporal_averaging if arguments.frame is None else None}
    for name, value in (alone if arguments.frames is None else others).items():
        if value is not None:
            raise LfsrError(f"{name} was given without --frames: give the frames, as in --frames 1-48"
                            if arguments.frames is None else
                            f"--frames {arguments.frames} and {name} were both given: leave out one of them")
    if arguments.check is not None:
        for name, value in {"--frames": arguments.frames, "--rows": arguments.rows}.items():
            if value is not None:
                raise LfsrError(f"--check {arguments.check} and {name} {value} were both given: leave out one of them")
        if arguments.layout == files.SUBPIXELS:
            raise LfsrError(f"--check needs a light field, but the layout {files.SUBPIXELS} renders none: choose "
                            "another layout")
        check_count(arguments.check, math.prod(load_display(arguments.display).lenses))
    if arguments.rays is not None and arguments.spp is not None:
        raise LfsrError(f"--rays {arguments.rays:g} and --spp {arguments.spp} were both given: leave out one of them")

    # Scale and samples, or scales and rays from which both follow.
    frames = None if arguments.frames is None else parse_frames(arguments.frames)
    display, subpixels = load_display(arguments.display), arguments.layout == files.SUBPIXELS
    if arguments.scale != AUTO_SCALE:
        scales: tuple[int, ...] = (int(arguments.scale),)
    elif subpixels:
        scales = (1,)
    else:
        scales = MethodName.parse(common.method_of(arguments.method, subpixels)).scales_of(scales_up_to(display))
    deciding = spread(parse_frames(arguments.scale_frames)) if arguments.scale_frames is not None else ()
    sampling = Sampling.of(display, scales, arguments.rays, arguments.spp, deciding, direct=subpixels)
    output = arguments.output if arguments.frames is None else os.path.abspath(arguments.output)
    request = common.make_request(arguments, output=output, layers=arguments.layers, sampling=sampling)
    finish = common.finish_of(arguments, subpixels, request.sampling.scale)
    if finish.temporal_averaging and frames is None:
        # A farm's task is told all frames, to choose the scale by their depth.
        folder = FrameFolder.of_frame(output, arguments.frame).path
        folder = Path(request.output) if request.rows or folder.name == Path(output).name else folder
        film = numbered(folder.parent) if arguments.scale_frames is None else parse_frames(arguments.scale_frames)
        seeds = finish.seeds_of(request.seed, [*film, arguments.frame])
        request = dataclasses.replace(request, seed=seeds[arguments.frame], output=str(folder))

    if arguments.check is not None:
        FrameFolder(f"{request.output}_reference").check_free("reference")
    started = time.monotonic()
    with progress() as bar:
        if arguments.cluster is not None:
            from lfsr_core.pipeline.cluster import make_on

            made = make_on(arguments.cluster, request, finish, frames or (), arguments.blender, arguments.overwrite,
                           bar)
        else:
            # A single image is always rendered again; an animation keeps the frames that are finished.
            made = make(request, None if request.rows else finish, frames, blender=arguments.blender, tell=bar,
                        overwrite=arguments.overwrite or frames is None)
        failed = [result for result in made if result.state == FAILED]
        if frames is None and request.rows is None:
            show_finished(FrameFolder(request.output), bar)
            if arguments.check is not None:
                from lfsr_core.metrics.eia_metrics import compare_with_reference

                metrics = compare_with_reference(request, request.output, f"{request.output}_reference",
                                                 arguments.check, CHECK_SAMPLES, arguments.blender, bar)
                bar.close()
                print("\n".join(metrics_table(metrics)))
    if request.rows is not None:
        print(f"{arguments.output}: rows {rows_text(request.rows)} of {request.display.lenses[1]}; join the parts with "
              "`lfsr merge`")
        return {"made": made}
    if frames is not None:
        print(f"{'frame':>7}  {'state':6}  {'render':>9}  {'finish':>9}")
        for result in made:
            rest = result.error or f"{result.render:7.1f} s  {result.finish:7.1f} s"
            print(f"{result.frame:7}  {result.state:6}  {rest}")
        counts = ", ".join(f"{sum(result.state == state for result in made)} {state}"
                           for state in ("made", "kept", FAILED))
        print(f"{len(made)} frames: {counts}, in {duration(time.monotonic() - started)}")
    if failed:
        raise LfsrError(f"{len(failed)} of {len(made)} frames failed, first frame {failed[0].frame} "
                        f"({failed[0].error}): run the same command again to render them")
    unseen = [[note for note in FrameFolder(result.folder).report.notes if note.code == "subject-unseen"]
              for result in made]
    if all(unseen) and not arguments.allow_empty:
        raise LfsrError(f"{sentence(unseen[0][0])}. Turn the camera, choose another --camera or --subject, or keep the "
                        f"image in {arguments.output} with --allow-empty")
    return {"made": made, "report": FrameFolder(request.output).report if frames is None else None}


def _scale(text: str) -> int | str:
    try:
        return text if text == AUTO_SCALE else int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a whole number nor {AUTO_SCALE!r}") from None


def upscale_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr upscale`."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="frame folder of `lfsr render`")
    parser.add_argument("--frame", type=int, metavar="N", help="frame N of the animation in DIR")
    parser.add_argument("--temporal-averaging", type=int, default=0, metavar="N",
                        help="average with the N frames before and after it where nothing has changed; for an "
                             "animation rendered with `lfsr render --temporal-averaging`")
    common.add_method_arguments(parser)


def run_upscale(arguments: argparse.Namespace) -> Any:
    """Upscale the folder and print the path of the image."""
    from lfsr_core.reconstruct.second_stage import finish_frame

    number, path = arguments.frame, arguments.folder
    folder = FrameFolder(path) if number is None else FrameFolder.of_frame(path, number)
    frame = folder.rendered
    finish = common.finish_of(arguments, bool(frame.subpixels), frame.scale)
    with progress() as bar:
        finish_frame(folder.path, finish, bar)
        show_finished(folder, bar)
    return {"folder": folder.path, "image": folder.image, "report": folder.report}


def show_finished(folder: FrameFolder, bar: ProgressBar) -> None:
    """Print the notices of the second stage, its times and its files."""
    report, frame = folder.report, folder.rendered
    for notice in report.notes:
        if notice not in frame.notes:  # which were shown during the render
            bar(notice)
    times = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in report.seconds.items())
    if frame.subpixels:
        print(f"{folder.image}: the panel's image, traced for its subpixels; {report.method} ({times})")
        return
    if frame.display.is_woven:
        print(f"{folder.path / 'panel.png'}: the panel's image, woven for its lens sheet")
    print(f"{folder.image}: {report.method}, {report.foreground_fraction:.0%} of the lenses are foreground ({times})")


def farm_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr farm`."""
    parser.add_argument("farm", choices=TEMPLATES, help="openjd: a job template of Open Job Description; flamenco: a "
                                                        "job type of Flamenco 3")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE",
                        help="default: " + " or ".join(TEMPLATES.values()) + " here")


def run_farm(arguments: argparse.Namespace) -> Any:
    """Write the template and print its path."""
    name = TEMPLATES[arguments.farm]
    output = arguments.output or Path(name)
    if output.is_dir():
        raise LfsrError(f"{output} is a folder, but the template is a file: give a file in it, as {output / name}")
    if output.suffix.lower() not in ((ending := Path(name).suffix), ending.replace("yaml", "yml")):
        raise LfsrError(f"the template is a {ending[1:]} file, but {output} was given: give -o FILE{ending}")
    write_template(arguments.farm, output)
    print(f"{output}: {NEXT[arguments.farm].replace('FILE', shlex.quote(str(output)))}")
    return {"file": output}


def merge_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr merge`."""
    parser.add_argument("parts", type=Path, nargs="+", metavar="PART",
                        help="folder of a part, in any order, or a folder of such folders")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="frame folder to write")
    parser.add_argument("--numbered", action="store_true",
                        help="write into a folder of DIR named by the frame's number, such as 0001")


def run_merge(arguments: argparse.Namespace) -> Any:
    """Join the parts and print the result."""
    from lfsr_core.pipeline.merge import merge, part_folders

    parts, output = part_folders(arguments.parts), arguments.output
    if arguments.numbered:
        output = FrameFolder.of_frame(output, FrameFolder(parts[0]).part.frame).path
    with progress() as bar:
        frame = merge(parts, output, bar)
    print(f"{output}: {len(parts)} parts, {frame.samples} samples, rendered in "
          f"{frame.seconds.get('render', 0.0):.1f} s in all")
    return {"folder": output, "parts": len(parts), "frame": frame}
