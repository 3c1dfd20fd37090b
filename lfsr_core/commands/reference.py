"""``lfsr reference SCENE -o DIR``: every view path-traced, as two independent halves."""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import ProgressBar
from lfsr_core.commands import arguments as common
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS
from lfsr_core.frames.request import Sampling
from lfsr_core.optics.lenses import check_count, choose_lenses

NAME = "reference"
HELP = "render the full-resolution reference as two independent halves"
DEFAULT_SAMPLES = 1024
SCALE_FOR_MASK, SAMPLES_FOR_MASK = 4, 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    common.add_scene_arguments(parser)
    parser.add_argument("--spp", type=int, default=DEFAULT_SAMPLES, metavar="N",
                        help="samples per pixel, default: %(default)s")
    parser.add_argument("--lenses", type=int, metavar="N",
                        help="only N random lenses, spread over the foreground; default: all")
    common.add_rows_argument(parser)
    common.add_cluster_argument(parser)


def run(arguments: argparse.Namespace) -> Any:
    """Choose lenses if asked to; render them at full resolution, unclamped."""
    from lfsr_core.frames.low_res import foreground_mask
    from lfsr_core.images.exr import read_layers
    from lfsr_core.pipeline.make import make

    if arguments.layout == SUBPIXELS:
        raise LfsrError(f"a reference is a light field, but the layout {SUBPIXELS} renders none: choose another layout")
    for first, second in (("rows", "cluster"), ("lenses", "rows")):
        if None not in (getattr(arguments, first), getattr(arguments, second)):
            raise LfsrError(f"--{first} {getattr(arguments, first)} and --{second} {getattr(arguments, second)} were "
                            "both given: leave out one of them")
    request = common.make_request(arguments, kind="reference", sampling=Sampling(1, arguments.spp), clamp_indirect=0.0)
    display = request.display
    with closing(ProgressBar(words=sentence)) as bar:
        if arguments.lenses is not None:
            check_count(arguments.lenses, math.prod(display.lenses))
            print(f"choosing {arguments.lenses} lenses from a quick render", file=sys.stderr)
            scale = min(display.scales(), key=lambda scale: abs(scale - SCALE_FOR_MASK), default=1)
            with tempfile.TemporaryDirectory() as name:
                quick = dataclasses.replace(request, kind="render", output=str(Path(name, "mask")),
                                            sampling=Sampling(scale, SAMPLES_FOR_MASK))
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
    print(f"{arguments.output}: {count} lenses, two halves of {request.sampling.samples // 2} samples")
    return {"folder": arguments.output, "lenses": count, "samples": request.sampling.samples}
