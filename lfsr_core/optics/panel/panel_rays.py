"""From a subpixel of a panel with a lens sheet straight to its rays: the reference for ``panel_layout.osl``.

A render of such rays has one pixel for each subpixel, side by side as they lie, all three colours of which are
traced; the panel shows the subpixel's own. The place in the pixel is the place in the subpixel, and says where on the
camera plane its light arrives; two random numbers choose the point on the lens. Both are spread over the whole
subpixel and the whole lens: to an eye a lens is one patch, in one colour from everywhere where it sees the subpixel.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import Geometry, lattice_point, nearest_point, point_rays
from lfsr_core.optics.rays import CameraArray, view_offset
from lfsr_core.optics.sheet import Subpixels

PERIOD = 4  # pixels after which every rule of cells repeats itself
CHANNELS = 3


class Parts(NamedTuple):
    """Subpixels of pixels, by row from the panel's bottom and column, both modulo PERIOD; (PERIOD, PERIOD, n) each."""

    right: Array  # offset from the pixel's centre, in pixels
    up: Array
    channel: Array  # 0 red … 2 blue; 0 where a subpixel shows all three


@dataclasses.dataclass(frozen=True)
class PanelLayout:
    """Which ray each pixel of a render of a panel's subpixels sends."""

    display: DisplayProfile  # woven
    array: CameraArray  # placement of the dense camera array
    aperture: float = 1.0  # share of a lens, along each axis, that rays cover, in [0, 1] (0: its middle)

    def __post_init__(self) -> None:
        check_sheet(self.display)

    @property
    def parts(self) -> int:
        """Subpixels of a pixel, side by side; 1 where one shows all three colours."""
        return _parts(self.display)

    @property
    def size(self) -> tuple[int, int]:
        """Rendered image size in pixels, (width, height)."""
        return rendered_size(self.display)

    @property
    def reach(self) -> float:
        """Scene units from the array's axis that no ray begins beyond, generously."""
        return 2 * max(self.display.views) * self.array.spacing


def check_sheet(display: DisplayProfile) -> None:
    """LfsrError unless the display has a lens sheet, whose subpixels send rays of their own."""
    if not display.is_woven:
        raise LfsrError(f"display {display.name!r} has no lens sheet, so that its elemental images are the panel's "
                        "image already: leave out --layout subpixels, or give a profile of format 2")


def rendered_size(display: DisplayProfile) -> tuple[int, int]:
    """Size in pixels, (width, height), of a render of the subpixels of a display with a lens sheet."""
    return display.panel_pixels[0] * _parts(display), display.panel_pixels[1]


def subpixel_table(layout: PanelLayout) -> Parts:
    """The subpixels of every pixel, from left to right in the panel's image."""
    if layout.parts == 1:
        return Parts(*(np.zeros((PERIOD, PERIOD, 1), kind) for kind in (float, float, int)))
    rows, columns = np.arange(PERIOD)[:, None], np.arange(PERIOD)
    each = [_subpixels(layout.display).offsets(channel, rows, columns) for channel in range(CHANNELS)]
    right, up = (np.stack([np.broadcast_to(pair[axis], (PERIOD, PERIOD)) for pair in each], -1) for axis in (0, 1))
    mirrored = layout.display.lenticular and layout.display.lenticular.flip[0]
    order = np.argsort(-right if mirrored else right, axis=-1, kind="stable")
    return Parts(np.take_along_axis(right, order, -1), np.take_along_axis(up, order, -1), order)


def panel_rays(layout: PanelLayout, raster_x: Array, raster_y: Array, random_x: Array | float = 0.5,
               random_y: Array | float = 0.5) -> tuple[Array, Array]:
    """Rays of points of the rendered image, in camera-array space, as ``rays.rays`` gives them.

    Parameters
    ----------
    layout : which ray each pixel sends
    raster_x, raster_y : in [0, 1), y up: the subpixel, and the place inside it
    random_x, random_y : in [0, 1), choose the point on the lens

    Returns
    -------
    Origins and unit directions, (..., 3) each
    """
    display, array = layout.display, layout.array
    seen = point_rays(display, *_panel_points(layout, raster_x, raster_y))
    right, up = lens_points(display, np.asarray(random_x, float), np.asarray(random_y, float))
    right, up = right * layout.aperture, up * layout.aperture
    width, height = Geometry.of(display).lens_plane
    target_x = ((seen.column + 0.5) / display.lenses[0] * 2 - 1 + 2 * right / width) * array.half_width
    target_y = (1 - (seen.row + 0.5) / display.lenses[1] * 2 + 2 * up / height) * array.half_height
    origin_x, origin_y = (view_offset(view, count, array.spacing)
                          for view, count in zip((seen.view_x, seen.view_y), display.views, strict=True))
    depth = np.full_like(target_x, array.distance)
    origin = np.stack(np.broadcast_arrays(origin_x, -origin_y, 0.0 * depth), axis=-1)
    direction = np.stack(np.broadcast_arrays(target_x, target_y, depth), axis=-1) - origin
    return origin, direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def lens_points(display: DisplayProfile, first: Array, second: Array) -> tuple[Array, Array]:
    """Millimetres (x, y) from the middle of a lens, or square to a cylinder's axis, of two numbers in [0, 1).

    Evenly over what lies nearer to that lens than to any other.
    """
    if display.lenticular:
        sheet, geometry = display.lenticular, Geometry.of(display)
        off = (first - 0.5) * sheet.pitch_mm * geometry.distance / (geometry.distance + geometry.gap)
        long = np.hypot(1, sheet.slant)
        return off / long, off * sheet.slant / long
    packing = display.lenslet.packing
    around = dataclasses.replace(display.lenslet.lenses, shift_mm=(0.0, 0.0))
    x, y = lattice_point(around, packing, first - 0.5, second - 0.5)
    near_x, near_y = lattice_point(around, packing, *nearest_point(around, packing, x, y))
    return x - near_x, y - near_y


def panel_image(layout: PanelLayout, traced: Array) -> Array:
    """The panel's picture (H, W, 3) of what its subpixels' rays bring: of each its own colour.

    ``traced``: (H, W · parts, 3), rows from the top.
    """
    if layout.parts == 1:
        return traced
    width, height = layout.display.panel_pixels
    by_pixel = traced.reshape(height, width, layout.parts, CHANNELS)
    rows, columns = _on_panel(layout, np.arange(height)[::-1], np.arange(width))
    channel = subpixel_table(layout).channel[rows[:, None] % PERIOD, columns % PERIOD]
    place = np.argsort(channel, axis=-1)  # of the part that shows each colour
    return np.take_along_axis(by_pixel, place[:, :, None], 2)[:, :, 0]


def _parts(display: DisplayProfile) -> int:
    return 1 if _subpixels(display).size == (1.0, 1.0) else CHANNELS


def _subpixels(display: DisplayProfile) -> Subpixels:
    return display.subpixels or Subpixels()


def _on_panel(layout: PanelLayout, rows: Array, columns: Array) -> tuple[Array, Array]:
    """Rows from the bottom and columns of the panel itself, of those of its image, which may be mirrored."""
    (across, down), sheet = layout.display.panel_pixels, layout.display.lenticular
    flip = sheet.flip if sheet else (False, False)
    return down - 1 - rows if flip[1] else rows, across - 1 - columns if flip[0] else columns


def _panel_points(layout: PanelLayout, raster_x: Array, raster_y: Array) -> tuple[Array, Array]:
    """Millimetres from the panel's centre, y up."""
    (across, down), parts = layout.display.panel_pixels, layout.parts
    at_x, at_y = (np.clip(np.asarray(raster, float) * count, 0, count - 1e-9)
                  for raster, count in zip((raster_x, raster_y), layout.size, strict=True))
    index, row = np.floor(at_x).astype(int), np.floor(at_y).astype(int)
    y, x = _on_panel(layout, row, index // parts)
    (right, up, _), (wide, high) = subpixel_table(layout), _subpixels(layout.display).size
    entry = y % PERIOD, x % PERIOD, index % parts
    return ((x + 0.5 + right[entry] + (at_x - index - 0.5) * wide) / across - 0.5) * layout.display.panel_mm[0], (
        (y + 0.5 + up[entry] + (at_y - row - 0.5) * high) / down - 0.5) * layout.display.panel_mm[1]
