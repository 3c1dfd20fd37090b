"""The ray of each point of a rendered image, in camera-array space: the reference for OSL, cards and synthetic renders.

Camera-array space is that of ``optics/rays.py``. Nothing here reads what the cards store.
"""

import dataclasses

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.display import DisplayProfile, Lenticular
from lfsr_core.optics.panel import subpixel_rays
from lfsr_core.optics.panel.subpixel_rays import Geometry, PanelLayout, lattice_point, nearest_point
from lfsr_core.optics.rays import RayLayout, view_offset


def rays(layout: RayLayout, raster_x: Array, raster_y: Array,
         random_x: Array | float = 0.5, random_y: Array | float = 0.5) -> tuple[Array, Array]:
    """Rays of points of the image: origins and unit directions, (..., 3) each, in camera-array space.

    ``raster_x``, ``raster_y``, in [0, 1) and y up, are the pixel; the place inside it chooses the point on the lens.
    ``random_x`` and ``random_y``, in [0, 1), choose the point in the view's cell.
    """
    width, height = layout.size
    tile_x, view_x, place_x = _split(raster_x, width, layout.views[0])
    tile_y, view_y, place_y = _split(raster_y, height, layout.views[1], downwards=True)
    lens = layout.shown_lenses[tile_y, tile_x]
    origin_x, target_x = _axis(layout, 0, lens[..., 1], view_x, place_x, random_x)
    # Rows count downwards and the camera's Y upwards: the same formula, mirrored.
    origin_y, target_y = _axis(layout, 1, lens[..., 0], view_y, place_y, 1 - np.asarray(random_y, float))
    return directed((origin_x, -origin_y), (target_x, -target_y), layout.array.distance)


def _split(raster: Array, pixels: int, views: int, downwards: bool = False) -> tuple[Array, Array, Array]:
    """Tile, view and place in the pixel of raster coordinates along one axis; a pixel includes its lower edge."""
    position = np.clip(np.asarray(raster, float) * pixels, 0, pixels - 1e-9)
    index = np.floor(position).astype(int)
    place = position - index
    if downwards:
        index, place = pixels - 1 - index, 1 - place
    return index // views, index % views, place


def _axis(layout: RayLayout, axis: int, lens: Array, view: Array, place: Array,
          random: Array | float) -> tuple[Array, Array]:
    """Origin on the camera plane and target on the display plane along one axis."""
    half = layout.array.half_size[axis]
    views, lenses = layout.views[axis], layout.lenses[axis]
    origin = view_offset(view, views, layout.spacing, layout.convention)
    if layout.convention == "paper":
        # Eq. (8): the target is the pixel's own place on the panel.
        return origin, ((lens * views + view + place) / (lenses * views) * 2 - 1) * half
    return origin + ((np.asarray(random) - 0.5) * layout.cell[axis]), ((lens + place) / lenses * 2 - 1) * half


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
    column = index // pixel.count
    row = down - 1 - line if display.flip[1] else line  # the image may be mirrored on the panel
    column = across - 1 - column if display.flip[0] else column
    (right, up, _), (wide, high) = subpixel_rays.subpixel_table(layout), pixel.size
    entry = row % subpixel_rays.PERIOD, column % subpixel_rays.PERIOD, index % pixel.count
    seen = subpixel_rays.point_rays(
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
    """Millimetres from a lens's centre or axis, even over what is nearest to it, for two numbers in [0, 1)."""
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


def directed(origin: tuple[Array, Array], target: tuple[Array, Array], distance: float) -> tuple[Array, Array]:
    """Origins and unit directions, (..., 3), of rays from the camera plane to a plane; (x, y) arrays broadcast."""
    depth = np.full_like(target[0], distance)
    start = np.stack(np.broadcast_arrays(*origin, 0.0 * depth), axis=-1)
    direction = np.stack(np.broadcast_arrays(*target, depth), axis=-1) - start
    return start, direction / np.linalg.norm(direction, axis=-1, keepdims=True)
