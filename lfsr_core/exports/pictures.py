"""Pictures of views: at a size that people look at, and written into folders of many."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.images.png import encode_png
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.methods.interpolation import cubic

MOST_WIDTH = 16384
PIXELS_PER_LENS, USUAL_WIDTHS = 10, (320, 1920)
REACH = 2  # samples of the cubic kernel to either side


def on_screen(view: Array, display: DisplayProfile, width: int) -> Array:
    """A view (sy, sx, 3) uint8 as (height, width, 3) with the panel's proportions; both are even, as videos need.

    LfsrError for a width that is no picture's.
    """
    width, height = screen_size(display, width)
    tall = _weights(view.shape[0], height) @ view.reshape(view.shape[0], -1).astype(np.float32)
    wide = np.matmul(_weights(view.shape[1], width), tall.reshape(height, view.shape[1], 3))
    return np.rint(np.clip(wide, 0, 255)).astype(np.uint8)


def screen_size(display: DisplayProfile, width: int) -> tuple[int, int]:
    """(width, height) in the panel's proportions, both even; LfsrError outside 16 to 16384."""
    height = width * display.panel_mm[1] / display.panel_mm[0]
    if not 16 <= width <= MOST_WIDTH or not 2 <= height <= MOST_WIDTH:
        raise LfsrError(f"width is {width}, but pictures are 16 to {MOST_WIDTH} pixels wide and high: choose another")
    return width // 2 * 2, max(2, round(height / 2) * 2)


def usual_width(display: DisplayProfile) -> int:
    """Width of pictures of which none was asked for: ten pixels per lens, within what screens show."""
    return min(max(PIXELS_PER_LENS * display.lenses[0], USUAL_WIDTHS[0]), USUAL_WIDTHS[1])


def save_png(path: Path, pixels: Array) -> None:
    """Write uint8 (H, W, 3) into a folder that nobody sees yet."""
    path.write_bytes(b"".join(encode_png(pixels)))


@functools.lru_cache(maxsize=8)
def _weights(size: int, target: int) -> Array:
    """(target, size) float32: cubic interpolation at pixel centres, over wider footprints where pixels get fewer."""
    stretch = max(1.0, size / target)
    places = (np.arange(target) + 0.5) * size / target - 0.5
    reach = int(np.ceil(REACH * stretch))
    taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
    weights = cubic((places[:, None] - taps) / stretch)
    matrix = np.zeros((target, size), np.float32)
    np.add.at(matrix, (np.arange(target)[:, None], np.clip(taps, 0, size - 1)),
              weights / weights.sum(1, keepdims=True))
    return matrix
