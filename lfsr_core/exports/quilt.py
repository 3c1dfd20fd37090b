"""Quilts: views side by side in one image, for Looking Glass displays and their programs.

Tile 0 is at the bottom left and holds the leftmost camera's view; tiles go rightwards, then upwards. The name holds
columns, rows and the panel's proportions: ``name_qs8x6a0.75.png``.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions
from lfsr_core.exports.screen_images import on_screen
from lfsr_core.images.png import write_png

MOST_SIDE = 16384  # pixels: no program takes more


def write(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """Write one quilt; return the notes."""
    if options.views and options.views[1] != 1:
        raise LfsrError(f"views are {options.views[0]}x{options.views[1]}, but a quilt has one row of cameras: give "
                        "one number")
    aspect = field.display.panel_mm[0] / field.display.panel_mm[1]
    count = options.views[0] if options.views else math.prod(options.grid or (field.count[0],))
    columns, rows = options.grid or _squarest(count, aspect)
    if columns * rows != count:
        raise LfsrError(f"a grid of {columns}x{rows} tiles does not hold just {count} views: choose one that does")
    width, height = (options.width,) * 2 if options.width is not None else field.display.lenses
    if max(width * columns, height * rows) > MOST_SIDE:
        raise LfsrError(f"a quilt of {columns}x{rows} tiles of {width}×{height} pixels is over {MOST_SIDE} pixels a "
                        "side: give fewer views or a smaller width")
    tiles = _row_of_views(field, count)
    if options.width is not None:
        tiles = [on_screen(tile, field.display, options.width) for tile in tiles]
    lines = [np.concatenate(tiles[start:start + columns], axis=1) for start in range(0, count, columns)]
    write_png(folder / f"{field.name}_qs{columns}x{rows}a{aspect:.4g}.png", np.concatenate(lines[::-1], axis=0))
    return []


def _row_of_views(field: LightField, count: int) -> list[Array]:
    """``count`` views (sy, sx, 3) at eye level, leftmost first.

    As many as the display has across: the rendered views of the row next above the middle. Another number: views at
    equal angles of the viewing cone, interpolated.
    """
    across, down = field.count
    if count == across:
        return list(field.views[(down - 1) // 2])
    cone, distance = math.radians(field.display.viewing_angle_deg), field.display.viewing_distance_mm
    angles = ((np.arange(count) + 0.5) / count - 0.5) * cone
    return [field.seen_from(distance * math.tan(angle)) for angle in angles]


def _squarest(count: int, aspect: float) -> tuple[int, int]:
    """Columns and rows of the quilt that is most nearly square, of tiles with this aspect ratio."""
    pairs = [(columns, count // columns) for columns in range(1, count + 1) if count % columns == 0]
    return min(pairs, key=lambda pair: abs(math.log(pair[0] * aspect / pair[1])))
