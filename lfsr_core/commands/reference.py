"""``lfsr reference`` and ``lfsr compare``: every view path-traced, as two halves, and metrics against it."""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.commands import common
from lfsr_core.commands.common import progress
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import LOW_RES_FILE, SUBPIXELS
from lfsr_core.frames.request import Sampling
from lfsr_core.optics.lenses import check_count, choose_lenses

if TYPE_CHECKING:
    from lfsr_core.metrics.eia_metrics import Metrics

DEFAULT_SAMPLES = 1024
SCALE_FOR_MASK, SAMPLES_FOR_MASK = 4, 4


def reference_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr reference`."""
    common.add_scene_arguments(parser)
    parser.add_argument("--spp", type=int, default=DEFAULT_SAMPLES, metavar="N",
                        help="samples per pixel, default: %(default)s")
    parser.add_argument("--lenses", type=int, metavar="N",
                        help="only N random lenses, spread over the foreground; default: all")


def run_reference(arguments: argparse.Namespace) -> Any:
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
    with progress() as bar:
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


def compare_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr compare`."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="finished frame folder")
    parser.add_argument("reference", type=Path, metavar="REFDIR", help="folder of `lfsr reference`")


def run_compare(arguments: argparse.Namespace) -> Any:
    """Compare and print."""
    from lfsr_core.metrics.eia_metrics import compare_folders

    metrics = compare_folders(arguments.folder, arguments.reference)
    print("\n".join(table(metrics)))
    return metrics


def table(metrics: Metrics) -> list[str]:
    """One line per known metric (value, 95 % interval of a sample of lenses, meaning), then one per note."""
    spread = {name: f" ± {half_width:.4f}" for name, half_width in metrics.ci95.items() if half_width is not None}
    lines = [f"{field.name:17} {value:8.4f}{spread.get(field.name, ''):10}  {field.metadata['meaning']}"
             for field in dataclasses.fields(metrics) if field.metadata
             and (value := getattr(metrics, field.name)) is not None]
    return [*lines, *map(sentence, metrics.notes)]
