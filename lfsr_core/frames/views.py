"""The EIA of a finished frame as an array of views, and back; images by which a person judges it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array, Bytes
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, read_frame, read_rendered
from lfsr_core.images.png import read_png, write_png
from lfsr_core.optics import eia
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import eye_view

VIEWS_ACROSS, GAP_PIXELS = 5, 4
SHEET_FILE, HORIZONTAL_EPI_FILE, VERTICAL_EPI_FILE, EYE_FILE = "views.png", "epi_x.png", "epi_y.png", "eye.png"
LEAST_EPI_HEIGHT, LEAST_VIEW_WIDTH = 160, 192


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


def contact_sheet(image: Array, lenses: tuple[int, int], across: int = VIEWS_ACROSS) -> Array:
    """Return a grid of evenly spaced views of an EIA (H, W, C) in view order; topmost, leftmost camera first.

    Views of few lenses are enlarged by repeating pixels.
    """
    views = eia.to_views(image, lenses)
    # Each in the middle of an equal part of all views.
    rows, columns = (((np.arange(shown) + 0.5) * count / shown).astype(int)
                     for count in views.shape[:2] for shown in [min(count, across)])
    times = _times(views.shape[3], LEAST_VIEW_WIDTH)
    shown = views[np.ix_(rows, columns)].repeat(times, axis=2).repeat(times, axis=3)
    padded = np.pad(shown, ((0, 0), (0, 0), (0, GAP_PIXELS), (0, GAP_PIXELS), (0, 0)), constant_values=255)
    return eia.from_elemental_images(padded)[:-GAP_PIXELS, :-GAP_PIXELS]


def epi_pair(image: Array, lenses: tuple[int, int]) -> tuple[Array, Array]:
    """Return the horizontal and the vertical epipolar image through the middle, (views, lenses, C), enlarged.

    A slanted line is a point in depth, a vertical one lies on the display.
    """
    px, py = eia.views_per_lens(image, lenses)
    return (_enlarged(eia.horizontal_epi(image, lenses, lenses[1] // 2, py // 2)),
            _enlarged(eia.vertical_epi(image, lenses, lenses[0] // 2, px // 2)))


def write_views(folder: str | Path, eye_mm: tuple[float, float, float] | None = None) -> list[Path]:
    """Write the contact sheet and both EPIs of a finished folder, and return the files; LfsrError without an EIA.

    ``eye_mm``: also write what an eye sees from there, in millimetres right, up and towards the viewer from the
    display's centre. Of direct subpixel rendering this is the only image.
    """
    folder = Path(folder)
    if eye_mm is not None and (frame := read_rendered(folder)).subpixels:
        write_png(folder / EYE_FILE, eye_view(read_png(folder / PANEL_FILE), frame.display, eye_mm))
        return [folder / EYE_FILE]
    display = read_frame(folder).display
    panel = read_png(folder / EIA_FILE)
    image = view_order(panel, display)
    images = dict(zip((HORIZONTAL_EPI_FILE, VERTICAL_EPI_FILE), epi_pair(image, display.lenses), strict=True))
    images[SHEET_FILE] = contact_sheet(image, display.lenses)
    if eye_mm is not None:
        shown = read_png(folder / PANEL_FILE) if display.is_woven else panel
        images[EYE_FILE] = eye_view(shown, display, eye_mm)
    for name, pixels in images.items():
        write_png(folder / name, pixels)
    return [folder / name for name in images]


def _enlarged(epi: Array) -> Array:
    times = _times(epi.shape[0], LEAST_EPI_HEIGHT)
    return epi.repeat(times, axis=0).repeat(times, axis=1)


def _times(pixels: int, least: int) -> int:
    """Return how often to repeat ``pixels`` to have at least ``least``."""
    return max(1, -(-least // pixels))
