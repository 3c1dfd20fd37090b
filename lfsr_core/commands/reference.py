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
from typing import TYPE_CHECKING

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import ProgressBar
from lfsr_core.commands import arguments as common
from lfsr_core.commands.renamed import add_old_option
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS
from lfsr_core.frames.request import Request, Sampling
from lfsr_core.optics.lens_sampling import check_count, choose_lenses
from lfsr_core.pipeline.store import Render, with_blender

if TYPE_CHECKING:
    from lfsr_core.pipeline.cluster import Cluster

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
    common.add_cluster_arguments(parser)
    parser.add_argument("--split", choices=("rows", "samples"),
                        help="divide the work by rows of lenses or by samples; default: rows, or samples with --lenses")
    parts = parser.add_argument("--parts", type=int, metavar="N", help="number of parts, default: two per worker")
    add_old_option(parser, "--shares", parts)


def run(arguments: argparse.Namespace) -> None:
    """Choose lenses if asked to; render them at full resolution, unclamped."""
    if arguments.layout == SUBPIXELS:
        raise LfsrError(f"a reference is a light field, but the layout {SUBPIXELS} renders none: choose another layout")
    job = common.make_request(arguments, kind="reference", sampling=Sampling(1, arguments.spp), clamp_indirect=0.0)
    cluster, render = common.chosen_cluster(arguments), with_blender(arguments.blender, announce=False)
    _check_split(arguments, cluster)
    if arguments.lenses is not None and job.rows is not None:
        raise LfsrError(f"--lenses {arguments.lenses} and --rows {arguments.rows} were both given: leave out one")
    if arguments.lenses is not None:
        check_count(arguments.lenses, math.prod(job.display.lenses))
        print(f"choosing {arguments.lenses} lenses from a quick render", file=sys.stderr)
        lens_list = choose_lenses(_quick_mask(render, job), arguments.lenses, arguments.seed)
        job = dataclasses.replace(job, lens_list=lens_list)
    if cluster is None:
        render(job)
    else:
        _render_on(cluster, arguments, job)
    print(f"{arguments.output}: {_count(job)} lenses, two halves of {job.sampling.samples // 2} samples")


def _check_split(arguments: argparse.Namespace, cluster: Cluster | None) -> None:
    """LfsrError for options that exclude each other."""
    if cluster is None:
        for name in ("split", "parts"):
            if getattr(arguments, name) is not None:
                raise LfsrError(f"--{name} was given without --workers or --cluster: add one of them, or leave it out")
    elif arguments.rows is not None:
        raise LfsrError(f"--rows {arguments.rows} renders a part already: leave out --rows, or --workers and "
                        "--cluster")


def _render_on(cluster: Cluster, arguments: argparse.Namespace, job: Request) -> None:
    from lfsr_core.pipeline.cluster_reference import ROWS, SAMPLES, Split, reference_on

    # Workers start in folders of their own.
    job = dataclasses.replace(job, output=os.path.abspath(job.output))
    split = Split(arguments.split or (SAMPLES if job.lens_list else ROWS), arguments.parts)
    with closing(ProgressBar()) as bar:
        reference_on(cluster, job, split, arguments.blender, bar)


def _count(job: Request) -> int:
    if job.rows is not None:
        return job.display.lenses[0] * (job.rows[1] - job.rows[0] + 1)
    return len(job.lens_list) if job.lens_list else math.prod(job.display.lenses)


def _quick_mask(render: Render, reference: Request) -> Array:
    """Foreground mask (sy, sx) from a few samples of every lens."""
    from lfsr_core.frames.foreground import foreground_mask
    from lfsr_core.images.exr import read_layers

    display = reference.display
    scale = min(display.scales(), key=lambda s: abs(s - SCALE_FOR_MASK), default=1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "mask"
        render(dataclasses.replace(reference, kind="render", output=str(folder),
                                   sampling=Sampling(scale, SAMPLES_FOR_MASK)))
        return foreground_mask(read_layers(folder / LOW_RES_FILE), display.lenses)
