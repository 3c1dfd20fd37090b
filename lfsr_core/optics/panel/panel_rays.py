"""The rays of a panel's subpixels, for direct subpixel rendering: the reference for ``panel_card.py``.

The render has one pixel for each subpixel, side by side as they lie on the panel. All three colours of a ray are
traced; the panel shows the subpixel's own. The place in the pixel is the place in the subpixel, and decides where on
the camera plane its light arrives; two random numbers choose the point on the lens. Rays cover the whole subpixel and
the whole lens, because an eye sees a lens as one patch, of one colour from every place that its subpixel lights.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import Geometry, lattice_point, nearest_point, point_rays
from lfsr_core.optics.rays import CameraArray, directed, view_offset
from lfsr_core.optics.sheet import Lenticular

PERIOD = 4  # pixels after which every cell rule repeats
CHANNELS = 3


class SubpixelTable(NamedTuple):
    """Subpixels by pixel row (from the panel's bottom) and column, both modulo PERIOD; (PERIOD, PERIOD, n) each."""

    right: Array  # offset from the pixel's centre, in pixels
    up: Array
    channel: Array  # 0 red … 2 blue; 0 if a subpixel shows all three


@dataclasses.dataclass(frozen=True)
class PanelLayout:
    """Which ray each pixel sends in a render of a panel's subpixels."""

    display: DisplayProfile  # with a lens sheet
    array: CameraArray  # placement of the dense camera array
    aperture: float = 1.0  # fraction of a lens, along each axis, that rays cover, in [0, 1] (0: its centre)

    def __post_init__(self) -> None:
        check_sheet(self.display)

    @property
    def size(self) -> tuple[int, int]:
        """Rendered image size in pixels, (width, height)."""
        return rendered_size(self.display)

    @property
    def reach(self) -> float:
        """Distance from the array's axis, in scene units, beyond which no ray starts (an upper bound)."""
        return 2 * max(self.display.views) * self.array.spacing


def check_sheet(display: DisplayProfile) -> None:
    """LfsrError unless the display has a lens sheet, so that its subpixels send rays of their own."""
    if not display.is_woven:
        raise LfsrError(f"display {display.name!r} has no lens sheet, so that its elemental images are the panel's "
                        "image already: render its elemental images, or give a profile of format 2")


def rendered_size(display: DisplayProfile) -> tuple[int, int]:
    """Size in pixels, (width, height), of a render of the subpixels of a display with a lens sheet."""
    return display.panel_pixels[0] * display.pixel_layout.count, display.panel_pixels[1]


def subpixel_table(layout: PanelLayout) -> SubpixelTable:
    """The subpixels of every pixel, from left to right in the panel's image."""
    if layout.display.pixel_layout.count == 1:
        zeros = np.zeros((PERIOD, PERIOD, 1))
        return SubpixelTable(zeros, zeros, zeros.astype(int))
    rows, columns = np.arange(PERIOD)[:, None], np.arange(PERIOD)
    each = [layout.display.pixel_layout.offsets(channel, rows, columns) for channel in range(CHANNELS)]
    right, up = (np.stack([np.broadcast_to(pair[axis], (PERIOD, PERIOD)) for pair in each], -1) for axis in (0, 1))
    order = np.argsort(-right if layout.display.flip[0] else right, axis=-1, kind="stable")
    return SubpixelTable(np.take_along_axis(right, order, -1), np.take_along_axis(up, order, -1), order)


def panel_rays(layout: PanelLayout, raster_x: Array, raster_y: Array, random_x: Array | float = 0.5,
               random_y: Array | float = 0.5) -> tuple[Array, Array]:
    """Rays of points of the rendered image: origins and unit directions, (..., 3) each, in camera-array space.

    ``raster_x``, ``raster_y``, in [0, 1) and y up, are the subpixel and the place inside it; ``random_x`` and
    ``random_y``, in [0, 1), choose the point on the lens.
    """
    display, array = layout.display, layout.array
    # The subpixel, and the place in millimetres from the panel's centre, y up.
    (across, down), pixel = display.panel_pixels, display.pixel_layout
    at_x, at_y = (np.clip(np.asarray(raster, float) * pixels, 0, pixels - 1e-9)
                  for raster, pixels in zip((raster_x, raster_y), layout.size, strict=True))
    index, line = np.floor(at_x).astype(int), np.floor(at_y).astype(int)
    row, column = _on_panel(layout, line, index // pixel.count)
    (right, up, _), (wide, high) = subpixel_table(layout), pixel.size
    entry = row % PERIOD, column % PERIOD, index % pixel.count
    seen = point_rays(
        display, ((column + 0.5 + right[entry] + (at_x - index - 0.5) * wide) / across - 0.5) * display.panel_mm[0],
        ((row + 0.5 + up[entry] + (at_y - line - 0.5) * high) / down - 0.5) * display.panel_mm[1])
    right, up = lens_points(display, np.asarray(random_x, float), np.asarray(random_y, float))
    right, up = right * layout.aperture, up * layout.aperture
    width, height = Geometry.of(display).lens_plane
    target_x = ((seen.column + 0.5) / display.lenses[0] * 2 - 1 + 2 * right / width) * array.half_width
    target_y = (1 - (seen.row + 0.5) / display.lenses[1] * 2 + 2 * up / height) * array.half_height
    origin_x, origin_y = (view_offset(view, count, array.spacing)
                          for view, count in zip((seen.view_x, seen.view_y), display.views, strict=True))
    return directed((origin_x, -origin_y), (target_x, target_y), array.distance)


def lens_points(display: DisplayProfile, first: Array, second: Array) -> tuple[Array, Array]:
    """Millimetres (x, y) from the centre of a lens, or from a cylinder's axis, for two numbers in [0, 1).

    Points cover evenly what lies nearer to that lens than to any other.
    """
    sheet = display.sheet
    if isinstance(sheet, Lenticular):
        geometry = Geometry.of(display)
        off = (first - 0.5) * sheet.pitch_mm * geometry.distance / (geometry.distance + geometry.gap)
        long = np.hypot(1, sheet.slant)
        return off / long, off * sheet.slant / long
    around = dataclasses.replace(sheet.lenses, shift_mm=(0.0, 0.0))
    x, y = lattice_point(around, sheet.packing, first - 0.5, second - 0.5)
    near_x, near_y = lattice_point(around, sheet.packing, *nearest_point(around, sheet.packing, x, y))
    return x - near_x, y - near_y


def panel_image(layout: PanelLayout, rendered: Array) -> Array:
    """Panel image (H, W, 3): each subpixel takes its own channel of its ray's colour.

    ``rendered``: of the rendered size, rows from the top.
    """
    if layout.display.pixel_layout.count == 1:
        return rendered
    width, height = layout.display.panel_pixels
    by_pixel = rendered.reshape(height, width, CHANNELS, CHANNELS)
    rows, columns = _on_panel(layout, np.arange(height)[::-1], np.arange(width))
    channel = subpixel_table(layout).channel[rows[:, None] % PERIOD, columns % PERIOD]
    place = np.argsort(channel, axis=-1)  # of the subpixel that shows each colour
    return np.take_along_axis(by_pixel, place[:, :, None], 2)[:, :, 0]


def _on_panel(layout: PanelLayout, rows: Array, columns: Array) -> tuple[Array, Array]:
    """Rows (from the bottom) and columns of the panel for those of its image, which may be mirrored."""
    (across, down), flip = layout.display.panel_pixels, layout.display.flip
    return down - 1 - rows if flip[1] else rows, across - 1 - columns if flip[0] else columns
