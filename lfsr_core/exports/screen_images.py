"""Views as images of a size for screens."""

from __future__ import annotations

import functools

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.methods.interpolation import cubic

MOST_WIDTH = 16384
PIXELS_PER_LENS, USUAL_WIDTHS = 10, (320, 1920)
REACH = 2  # samples of the cubic kernel to either side


def on_screen(view: Array, display: DisplayProfile, width: int, part: tuple[float, float] = (1, 1)) -> Array:
    """Resample a view (sy, sx, 3) uint8 to (height, width, 3) in the panel's proportions, both even, as videos need.

    ``part``: factors by which the result is narrower and lower than these proportions. LfsrError for a width or height
    outside 16 to 16384 pixels.
    """
    return resized(view, screen_size(display, width, part))


def screen_size(display: DisplayProfile, width: int, part: tuple[float, float] = (1, 1)) -> tuple[int, int]:
    """(width, height) of what ``on_screen`` makes; LfsrError as there."""
    height = width * display.panel_mm[1] / display.panel_mm[0]
    if not 16 <= width <= MOST_WIDTH or not 2 <= height <= MOST_WIDTH:
        raise LfsrError(f"width is {width}, but images are 16 to {MOST_WIDTH} pixels wide and high: choose another")
    return int(width * part[0]) // 2 * 2, max(2, round(height * part[1] / 2) * 2)


def resized(view: Array, size: tuple[int, int], covers: tuple[float, float] = (1, 1)) -> Array:
    """Resample a view (sy, sx, 3) uint8 to ``size`` (width, height) pixels.

    ``covers``: fractions of the result's width and height that the view takes, in the middle; above 1 it is cut, below
    1 the rest is black.
    """
    if view.shape[1::-1] == size and covers == (1, 1):
        return view
    columns, rows = size
    tall = _weights(view.shape[0], rows, covers[1]) @ view.reshape(view.shape[0], -1).astype(np.float32)
    wide = np.matmul(_weights(view.shape[1], columns, covers[0]), tall.reshape(rows, view.shape[1], 3))
    return np.asarray(np.rint(np.clip(wide, 0, 255)), np.uint8)


def usual_width(display: DisplayProfile) -> int:
    """Default width: ten pixels per lens, within what screens show."""
    return min(max(PIXELS_PER_LENS * display.lenses[0], USUAL_WIDTHS[0]), USUAL_WIDTHS[1])


@functools.lru_cache(maxsize=8)
def _weights(size: int, target: int, covers: float = 1) -> Array:
    """Weights (target, size) float32 of cubic interpolation at pixel centres; downscaling widens the kernel."""
    stretch = max(1.0, size / target / covers)
    places = ((np.arange(target) + 0.5) / target - 0.5) / covers * size + size / 2 - 0.5
    reach = int(np.ceil(REACH * stretch))
    taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
    weights = cubic((places[:, None] - taps) / stretch)
    matrix = np.zeros((target, size), np.float32)
    np.add.at(matrix, (np.arange(target)[:, None], np.clip(taps, 0, size - 1)),
              weights / weights.sum(1, keepdims=True))
    matrix[(places < -0.5) | (places > size - 0.5)] = 0
    return matrix
