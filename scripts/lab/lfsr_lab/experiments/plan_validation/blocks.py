"""How many neighbours must a sampled lens have?

    python -m lfsr_lab.experiments.plan_validation.blocks FRAME REFERENCE --method NAME

Lenses of a whole frame are finished once with the whole frame around them and once
in a mosaic of small blocks, as a plan sees them, and both are held against the
reference: what differs is the error of looking at single lenses.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.frame import LOW_RES_FILE, read_frame
from lfsr_core.frames.low_res import LowResEIA, low_resolution, read_world
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.plan.sample import Lens, Mosaic, with_neighbours
from lfsr_core.reconstruct.registry import method
from lfsr_core.reconstruct.second_stage import finished_lenses, finished_linear
from lfsr_lab.experiments.engine.accuracy import Target, lens_ssims

REACHES = (0, 1, 2, 3)
REACHES_IN_A_VIEW = (0, 2, 4, 8, 16)  # where views differ along one axis, and the denoiser sees a pixel per lens
MOST_LENSES = 48  # of a whole reference


def differences(folder: Path, reference: Path, name: str) -> Iterator[tuple[int, Array]]:
    """Neighbours on each side, and by how much that changes the split SSIM (n,) of each foreground lens."""
    frame = read_frame(folder)
    target = Target.read(reference, np.ones(frame.display.lenses[::-1], bool))
    target.check(frame)
    known = target.reference
    shown = np.flatnonzero(known.foreground)
    shown = shown[np.arange(0, len(shown), -(-len(shown) // MOST_LENSES))]
    lenses = [(int(row), int(column)) for row, column in known.lenses[shown]]
    halves = [half[shown] for half in known.elemental_images()]
    low = low_resolution(clean(read_layers(folder / LOW_RES_FILE))[0], frame, read_world(folder, frame))
    whole = to_elemental_images(finished_linear(folder, name), frame.display.lenses)[tuple(np.array(lenses).T)]
    usual = lens_ssims(srgb_encode(whole), *halves)
    for reach in REACHES if all(frame.display.parallax) else REACHES_IN_A_VIEW:
        listed, blocks = with_neighbours(lenses, reach, frame.display.lenses)
        mosaic = Mosaic.of(blocks)
        images = finished_lenses(mosaic.of_render(_listed(low, listed)), np.ones(len(lenses), bool), method(name),
                                 mosaic.centres)
        yield reach, lens_ssims(srgb_encode(images), *halves) - usual


def _listed(low: LowResEIA, lenses: list[Lens]) -> LowResEIA:
    """One row of tiles, as a render of just these lenses would be."""
    rows, columns = np.asarray(lenses).T
    return low.each(lambda layer: layer[rows, columns][None])


def main(argv: Sequence[str] | None = None) -> int:
    """Print one line per number of neighbours."""
    parser = argparse.ArgumentParser(prog="plan_blocks", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="frame folder of `lfsr render`")
    parser.add_argument("reference", type=Path, help="reference of the same frame, whole or of sampled lenses")
    parser.add_argument("--method", required=True)
    options = parser.parse_args(argv)
    print("neighbours  mean change  its standard error  standard deviation over lenses")
    for reach, change in differences(options.folder, options.reference, options.method):
        deviation = float(change.std(ddof=1))
        print(f"{reach:10}  {change.mean():+11.5f}  {deviation / len(change) ** 0.5:18.5f}  {deviation:.5f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
