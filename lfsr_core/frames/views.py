"""Convert the EIA of a finished frame into an array of views, and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array, Bytes
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import EIA_FILE, read_frame
from lfsr_core.images.png import read_png
from lfsr_core.optics import eia
from lfsr_core.optics.display import DisplayProfile


def read_views(folder: str | Path) -> Bytes:
    """Views (py, px, sy, sx, 3) uint8 of a finished frame folder: the display values of its eia.png.

    ``views[row, column]`` is the image that one camera sees; row 0 is the topmost camera, column 0 the leftmost.
    LfsrError where eia.png is missing or of another size than the display.
    """
    return np.ascontiguousarray(eia_to_views(read_png(Path(folder) / EIA_FILE), read_frame(folder).display))


def eia_to_views(panel: Array, display: DisplayProfile) -> Array:
    """EIA (H, W, C) in panel order, as in eia.png -> views (py, px, sy, sx, C); LfsrError if it has another size."""
    return eia.to_views(view_order(panel, display), display.lenses)


def views_to_eia(views: Array, display: DisplayProfile) -> Array:
    """Views (py, px, sy, sx, C) -> EIA (H, W, C) in panel order, as in eia.png; LfsrError for another shape."""
    expected = (*display.views[::-1], *display.lenses[::-1])
    if views.ndim != 5 or views.shape[:4] != expected:
        raise LfsrError(f"views have shape {views.shape}, but display {display.name!r} needs {expected} and "
                        "channels")
    image = eia.from_views(views)
    return eia.flip_order(image, display.lenses) if display.ei_order == "flipped" else image


def view_order(panel: Array, display: DisplayProfile) -> Array:
    """EIA (H, W, C) in panel order -> view order; LfsrError if it has another size than the display's EIA."""
    width, height = display.eia_pixels
    if panel.shape[:2] != (height, width):
        raise LfsrError(f"the EIA has {panel.shape[1]}×{panel.shape[0]} pixels, but display {display.name!r} has "
                        f"{width}×{height}: upscale the folder again")
    return eia.flip_order(panel, display.lenses) if display.ei_order == "flipped" else panel
