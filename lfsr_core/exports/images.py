"""Single images of a light field: quilts, stereo pairs of two eyes, anaglyphs, and RGB-D.

Quilts are for Looking Glass displays and their programs. Tile 0 is at the bottom left and holds the leftmost camera's
view; tiles go rightwards, then upwards. The name holds columns, rows and the panel's proportions.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.base.notices import Notice
from lfsr_core.exports.light_field import (
    LightField,
    infinite_disparity,
    on_screen,
    rendered_disparity,
    resized,
    screen_size,
    usual_width,
)
from lfsr_core.exports.options import PRESETS, ExportOptions, Pair, Preset, quilt_name
from lfsr_core.images.color import srgb_decode, srgb_encode
from lfsr_core.images.png import write_png

MOST_SIDE = 16384  # pixels; no program takes more
EYES_MM = 63.0
LEAST_SPAN = 1e-6  # of disparities, in pixels per view
# Left and right eye's linear red, green and blue to those of red-cyan glasses on a liquid crystal display: E. Dubois,
# "Conversion of a stereo pair to anaglyph with the least-squares projection method", March 2009.
DUBOIS = np.array([[[0.437, 0.449, 0.164], [-0.062, -0.062, -0.024], [-0.048, -0.050, -0.017]],
                   [[-0.011, -0.032, -0.007], [0.377, 0.761, 0.009], [-0.026, -0.093, 1.234]]], np.float32)


def write_quilt(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one quilt."""
    grid, tile = quilt_layout(field, options)
    write_png(folder / f"{quilt_name(field.name, grid, panel_aspect(field))}.png", quilt_of_views(field, grid, tile))


def panel_aspect(field: LightField) -> float:
    return field.display.panel_mm[0] / field.display.panel_mm[1]


def quilt_layout(field: LightField, options: ExportOptions) -> tuple[Pair, Pair]:
    """Tiles and their pixels: as asked for, those of the display's model, or all views of a display without."""
    asked = options.views or options.grid or options.width
    if options.preset and asked:
        raise LfsrError(f"preset {options.preset!r} decides views, grid and width of a quilt: leave these out")
    if options.preset and options.preset not in PRESETS:
        raise LfsrError(f"preset is {options.preset!r}: {did_you_mean(options.preset, PRESETS)}Choose from "
                        f"{', '.join(PRESETS)}")
    shape = options.shape or field.display.quilt
    preset = PRESETS[options.preset] if options.preset else shape and Preset(shape[:2], shape[2:])
    if preset and not asked:
        grid, tile = preset.grid, preset.tile
    else:
        if options.views and options.views[1] != 1:
            raise LfsrError(f"views are {options.views[0]}x{options.views[1]}, but a quilt has one row of cameras: "
                            "give one number")
        count = options.views[0] if options.views else math.prod(options.grid or (field.count[0],))
        pairs = [(columns, count // columns) for columns in range(1, count + 1) if count % columns == 0]
        # By default the quilt is as nearly square as the tiles' aspect ratio allows.
        grid = options.grid or min(pairs, key=lambda pair: abs(math.log(pair[0] * panel_aspect(field) / pair[1])))
        if math.prod(grid) != count:
            raise LfsrError(f"a grid of {grid[0]}x{grid[1]} tiles does not hold just {count} views: choose one that "
                            "does")
        tile = field.display.lenses if options.width is None else screen_size(field.display, options.width)
    if max(tile[0] * grid[0], tile[1] * grid[1]) > MOST_SIDE:
        raise LfsrError(f"a quilt of {grid[0]}x{grid[1]} tiles of {tile[0]}×{tile[1]} pixels is over {MOST_SIDE} "
                        "pixels a side: give fewer views or a smaller width")
    return grid, tile


def quilt_of_views(field: LightField, grid: Pair, tile: Pair) -> Array:
    """Quilt (H, W, 3) uint8 of the views at eye level.

    As many as the display has across: the rendered views of the row next above the middle. Another number: views at
    equal angles of the viewing cone, interpolated.
    """
    (columns, rows), (across, down) = grid, field.count
    if columns * rows == across:
        views = list(field.views[(down - 1) // 2])
    else:
        cone, distance = math.radians(field.display.viewing_angle_deg), field.display.viewing_distance_mm
        angles = ((np.arange(columns * rows) + 0.5) / (columns * rows) - 0.5) * cone
        views = [field.seen_from(distance * math.tan(angle)) for angle in angles]
    tiles = [resized(view, tile) for view in views]
    lines = [np.concatenate(tiles[row * columns:(row + 1) * columns], axis=1) for row in range(rows)]
    return np.concatenate(lines[::-1], axis=0)


class Layout(NamedTuple):
    """How the two eyes' images, (H, W, 3) uint8, become one."""

    suffix: str  # in the file's name, by which players know the layout
    size: tuple[float, float]  # of each image, by a whole one's width and height
    axis: int | None  # along which they are joined; None: as an anaglyph


LAYOUTS = {
    "stereo": Layout("stereo", (1, 1), 1), "half-side-by-side": Layout("hsbs", (0.5, 1), 1),
    "top-bottom": Layout("tab", (1, 1), 0), "half-top-bottom": Layout("htab", (1, 0.5), 0),
    "anaglyph": Layout("anaglyph", (1, 1), None),
}


def anaglyph(left: Array, right: Array) -> Array:
    """Image (H, W, 3) uint8 for red-cyan glasses, of two images of that shape."""
    eyes = np.stack([srgb_decode(image.astype(np.float32) / 255) for image in (left, right)])
    mixed = np.einsum("eoc,ehwc->hwo", DUBOIS, eyes)
    return np.asarray(np.rint(srgb_encode(np.clip(mixed, 0, 1)) * 255), np.uint8)


def write_stereo(layout: Layout, field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one image, the left eye's half on the left or on top."""
    between = eye_distance(field, options)
    width = options.width or usual_width(field.display)
    pair = [on_screen(field.seen_from(x), field.display, width, layout.size) for x in (-between / 2, between / 2)]
    joined = anaglyph(*pair) if layout.axis is None else np.concatenate(pair, layout.axis)
    write_png(folder / f"{field.name}_{layout.suffix}_{between:g}mm.png", joined)


def eye_distance(field: LightField, options: ExportOptions) -> float:
    """Millimetres between the eyes; LfsrError where they do not both see the display's views."""
    between = options.eyes_mm or EYES_MM
    zone = field.display.camera_spacing_mm * field.count[0]
    if between > zone:
        raise LfsrError(f"eyes {between:g} mm apart are outside the viewing zone of display {field.display.name!r}, "
                        f"which is {zone:.0f} mm wide at the viewing distance: choose a smaller distance")
    return between


def write_rgbd(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write colour left and depth right, near is white, as Looking Glass' programs take them.

    Depth is linear in disparity; tells where on it the display's plane is.
    """
    rendered = rendered_disparity(field)
    if rendered is None:
        raise LfsrError(f"{field.folder} has no position layer, from which depth comes: render it with the "
                        "layer position")
    color = on_screen(field.view_at(*rendered.place), field.display, options.width or usual_width(field.display))
    disparity, infinite = rendered.disparity, infinite_disparity(field.frame)
    hit = disparity[disparity > infinite]
    far, near = (float(hit.min()), float(hit.max())) if hit.size else (infinite, 0.0)
    if near - far < LEAST_SPAN:  # all at one depth: emptiness is behind it
        far = min(infinite, near - LEAST_SPAN)
    nearness = np.clip((disparity - far) / (near - far), 0, 1)  # emptiness is as far as the farthest that is hit
    rows, columns = (np.arange(size) * count // size
                     for size, count in zip(color.shape[:2], nearness.shape, strict=True))
    grey = np.rint(nearness[rows][:, columns] * 255).astype(np.uint8)  # the nearest lens: no depth between two things
    write_png(folder / f"{field.name}_rgbd.png", np.concatenate([color, np.repeat(grey[..., None], 3, 2)], axis=1))
    options.tell(Notice("display-plane", {"depth": float(np.clip(-far / (near - far), 0, 1))}))
