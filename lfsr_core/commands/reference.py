"""``lfsr reference SCENE -o DIR``: the high-resolution truth, as two independent halves."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from lfsr_core.commands import _scene
from lfsr_core.frame import LOW_RES_FILE
from lfsr_core.lens_choice import choose_lenses
from lfsr_core.render_job import DEFAULT_REFERENCE_SAMPLES

NAME = "reference"
HELP = "render the high-resolution reference as two independent halves"
SAMPLES_FOR_MASK = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    _scene.add_scene_arguments(parser, DEFAULT_REFERENCE_SAMPLES)
    parser.add_argument("--lenses", type=int, metavar="N",
                        help="only N random lenses, spread over the foreground; default: all")


def run(arguments: argparse.Namespace) -> None:
    """Choose lenses if asked to, then render them at full resolution, unclamped."""
    job = _scene.make_job(arguments, kind="reference", scale=1, layers=(), clamp_indirect=0.0)
    lens_list = None
    if arguments.lenses is not None:
        mask = _quick_mask(arguments)
        lens_list = choose_lenses(mask, arguments.lenses, arguments.seed)
    job = _scene.make_job(arguments, kind="reference", scale=1, layers=(), clamp_indirect=0.0, lens_list=lens_list)
    _scene.render(arguments, job, arguments.output)
    count = len(lens_list) if lens_list else job.display.lenses[0] * job.display.lenses[1]
    print(f"{arguments.output}: {count} lenses, two halves of {job.samples // 2} samples")


def _quick_mask(arguments: argparse.Namespace) -> np.ndarray:
    """Foreground mask (sy, sx) from a few samples of every lens, in a folder that is thrown away."""
    from lfsr_core.foreground import foreground_mask
    from lfsr_core.image_io import read_layers

    display = _scene.make_job(arguments, scale=1).display
    scale = next(iter(sorted(display.scales(), key=lambda s: abs(s - 4))), 1)
    job = _scene.make_job(arguments, scale=scale, samples=SAMPLES_FOR_MASK, layers=("index",))
    with tempfile.TemporaryDirectory() as folder:
        _scene.render(arguments, job, Path(folder) / "mask")
        return foreground_mask(read_layers(Path(folder) / "mask" / LOW_RES_FILE), display.lenses)
