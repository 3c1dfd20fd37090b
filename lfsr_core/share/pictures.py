"""Pictures of views: at a size that people look at, and written into folders of many."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.errors import LfsrError
from lfsr_core.images.png import encode_png
from lfsr_core.optics.display import DisplayProfile

FILTER = "mitchell"  # no ringing around edges that are enlarged ten times
MOST_WIDTH = 16384


def on_screen(view: np.ndarray, display: DisplayProfile, width: int) -> np.ndarray:
    """A view (sy, sx, 3) uint8 as (height, width, 3) with the panel's proportions; both are even, as videos need.

    LfsrError for a width that is no picture's.
    """
    width, height = screen_size(display, width)
    source = oiio.ImageBuf(np.ascontiguousarray(view))
    result = oiio.ImageBufAlgo.resize(source, filtername=FILTER, roi=oiio.ROI(0, width, 0, height, 0, 1, 0, 3))
    return result.get_pixels(oiio.UINT8).reshape(height, width, 3)


def screen_size(display: DisplayProfile, width: int) -> tuple[int, int]:
    """(width, height) in the panel's proportions, both even; LfsrError outside 16 to 16384."""
    height = width * display.panel_mm[1] / display.panel_mm[0]
    if not 16 <= width <= MOST_WIDTH or not 2 <= height <= MOST_WIDTH:
        raise LfsrError(f"width is {width}, but pictures are 16 to {MOST_WIDTH} pixels wide and high: choose another")
    return width // 2 * 2, max(2, round(height / 2) * 2)


def save_png(path: Path, pixels: np.ndarray) -> None:
    """Write uint8 (H, W, 3) into a folder that nobody sees yet."""
    path.write_bytes(b"".join(encode_png(pixels)))
