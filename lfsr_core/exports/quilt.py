"""Quilts: views side by side in one picture, as Looking Glass displays and their programs take them.

Tile 0 is at the bottom left and holds the leftmost camera's view; tiles go
rightwards, then upwards. The name says columns, rows and the panel's proportions:
``name_qs8x6a0.75.png``.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions
from lfsr_core.exports.pictures import on_screen, save_png

MOST_SIDE = 16384  # pixels: no program takes more


def write(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """Write one quilt; the notes."""
    if options.views and options.views[1] != 1:
        raise LfsrError(f"views are {options.views[0]}x{options.views[1]}, but a quilt has one row of cameras: give "
                        "one number")
    columns, rows = _grid(field, options)
    wanted = options.views[0] if options.views else columns * rows
    if columns * rows != wanted:
        raise LfsrError(f"a grid of {columns}x{rows} tiles does not hold just {wanted} views: choose one that does")
    tiles = row_of_views(field, wanted)
    _check_size(tiles[0].shape[:2] if options.width is None else (options.width, options.width), (columns, rows))
    if options.width is not None:
        tiles = [on_screen(tile, field.display, options.width) for tile in tiles]
    save_png(folder / file_name(field, columns, rows), assemble(tiles, columns))
    return []


def file_name(field: LightField, columns: int, rows: int) -> str:
    """Name that tells players how the quilt is laid out."""
    aspect = field.display.panel_mm[0] / field.display.panel_mm[1]
    return f"{field.name}_qs{columns}x{rows}a{aspect:.4g}.png"


def row_of_views(field: LightField, count: int) -> list[Array]:
    """``count`` views (sy, sx, 3) at eye level, leftmost first.

    As many as the display has across: its own, untouched, of the row next above the
    middle. Another number: at equal angles of the viewing cone, between cameras.
    """
    across, down = field.count
    if count == across:
        return list(field.views[(down - 1) // 2])
    cone, distance = math.radians(field.display.viewing_angle_deg), field.display.viewing_distance_mm
    angles = ((np.arange(count) + 0.5) / count - 0.5) * cone
    return [field.seen_from(distance * math.tan(angle)) for angle in angles]


def assemble(tiles: list[Array], columns: int) -> Array:
    """(rows · h, columns · w, 3) of tiles (h, w, 3) from the bottom left."""
    rows = [np.concatenate(tiles[start:start + columns], axis=1) for start in range(0, len(tiles), columns)]
    return np.concatenate(rows[::-1], axis=0)


def _grid(field: LightField, options: ExportOptions) -> tuple[int, int]:
    """Columns and rows: as asked for, else those that make the quilt most nearly square."""
    if options.grid:
        return options.grid
    count = options.views[0] if options.views else field.count[0]
    aspect = field.display.panel_mm[0] / field.display.panel_mm[1]
    pairs = [(columns, count // columns) for columns in range(1, count + 1) if count % columns == 0]
    return min(pairs, key=lambda pair: abs(math.log(pair[0] * aspect / pair[1])))


def _check_size(tile: tuple[int, int], grid: tuple[int, int]) -> None:
    if max(tile[1] * grid[0], tile[0] * grid[1]) > MOST_SIDE:
        raise LfsrError(f"a quilt of {grid[0]}x{grid[1]} tiles of {tile[1]}×{tile[0]} pixels is over {MOST_SIDE} "
                        "pixels a side: give fewer views or a smaller width")
