"""How many neighbours must a sampled lens have? ``python -m lfsr_core.bench.plan.blocks FRAME REFERENCE --method NAME``

Lenses of a whole frame are finished once with the whole frame around them and once
in a mosaic of small blocks, as a plan sees them, and both are held against the
reference: what differs is the error of looking at single lenses.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.frames.frame import LOW_RES_FILE, REFERENCE_FILES, read_frame
from lfsr_core.frames.low_res import LowResEIA, low_resolution
from lfsr_core.frames.reference import check_reference, read_half
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.split_ssim import stacked_ssim
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.plan.sample import Lens, Mosaic, with_neighbours
from lfsr_core.plan.score import finished
from lfsr_core.reconstruct.registry import method
from lfsr_core.reconstruct.second_stage import finished_linear

REACHES = (0, 1, 2, 3)


def differences(folder: Path, reference: Path, name: str) -> Iterator[tuple[int, np.ndarray]]:
    """Neighbours on each side, and by how much that changes the split SSIM (n,) of each foreground lens."""
    frame = read_frame(folder)
    check_reference(frame, read_frame(reference))
    lenses, halves = _reference(reference)
    low = low_resolution(clean(read_layers(folder / LOW_RES_FILE))[0], frame)
    whole = to_elemental_images(finished_linear(folder, name), frame.display.lenses)[tuple(np.array(lenses).T)]
    known = _ssim(whole, halves)
    for reach in REACHES:
        listed, blocks = with_neighbours(lenses, reach, frame.display.lenses)
        mosaic = Mosaic.of(blocks)
        images = finished(mosaic.of_render(_listed(low, listed)), np.ones(len(lenses), bool), method(name),
                          mosaic.centres)
        yield reach, _ssim(images, halves) - known


def _reference(folder: Path) -> tuple[list[Lens], list[np.ndarray]]:
    """Lenses with foreground, and each half's elemental images of them (n, py, px, 3) as sRGB values."""
    frame = read_frame(folder)
    sx, sy = frame.display.lenses
    listed = frame.lens_list or tuple((row, column) for row in range(sy) for column in range(sx))
    images, hits = zip(*(read_half(folder / name, frame) for name in REFERENCE_FILES), strict=True)
    hit = np.any(hits, 0).reshape(-1)[:len(listed)]
    tiles = [to_elemental_images(image, frame.rays.tiles) for image in images]
    halves = [srgb_encode(tile.reshape(-1, *tile.shape[2:])[:len(listed)][hit]) for tile in tiles]
    return [lens for lens, shows in zip(listed, hit, strict=True) if shows], halves


def _listed(low: LowResEIA, lenses: list[Lens]) -> LowResEIA:
    """One row of tiles, as a render of just these lenses would be."""
    rows, columns = np.asarray(lenses).T
    aux = {name: layer[rows, columns][None] for name, layer in low.aux.items()}
    return dataclasses.replace(low, color=low.color[rows, columns][None], alpha=low.alpha[rows, columns][None], aux=aux)


def _ssim(images: np.ndarray, halves: list[np.ndarray]) -> np.ndarray:
    return stacked_ssim(srgb_encode(images), *halves).mean((1, 2))


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
