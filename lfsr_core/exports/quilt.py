"""Quilts: views side by side in one image, for Looking Glass displays and their programs.

Tile 0 is at the bottom left and holds the leftmost camera's view; tiles go rightwards, then upwards. The name holds
columns, rows and the panel's proportions: ``name_qs8x6a0.75.png``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Progress
from lfsr_core.exports.films import write_film as write_frames
from lfsr_core.exports.format_names import QUILT_FILM_TYPES
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions, chosen_type
from lfsr_core.exports.quilt_names import Pair, find_preset, quilt_name, usual_preset
from lfsr_core.exports.screen_images import resized, screen_size
from lfsr_core.images.png import write_png

MOST_SIDE = 16384  # pixels: no program takes more
ANIMATION_RATE = 24  # Blender's default


def write(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one quilt."""
    grid, tile = _layout(field, options)
    write_png(folder / f"{quilt_name(field.name, grid, _aspect(field))}.png", _quilt(field, grid, tile))


def write_one_frame(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write the film of one frame."""
    write_film(iter([field]), 1, folder, options)


def write_film(fields: Iterator[LightField], count: int, folder: Path, options: ExportOptions) -> None:
    """Write ``count`` quilts as a film, of even sides, as its encoders need."""
    first = next(fields)
    grid, (width, height) = _layout(first, options)
    tile = width - width * grid[0] % 2, height - height * grid[1] % 2
    name = f"{quilt_name(first.name, grid, _aspect(first))}.{chosen_type(options, QUILT_FILM_TYPES)}"

    def quilts() -> Iterator[Array]:
        for number, field in enumerate(itertools.chain([first], fields)):
            options.tell(Progress("export", number / count, f"frame {number + 1} of {count}"))
            yield _quilt(field, grid, tile)

    write_frames(folder / name, quilts(), options.fps or ANIMATION_RATE)


def _aspect(field: LightField) -> float:
    return field.display.panel_mm[0] / field.display.panel_mm[1]


def _layout(field: LightField, options: ExportOptions) -> tuple[Pair, Pair]:
    """Tiles and their pixels: as asked for, the preset of the display's panel, or all views of a display without."""
    asked = options.views or options.grid or options.width
    if options.preset and asked:
        raise LfsrError(f"preset {options.preset!r} decides views, grid and width of a quilt: leave these out")
    preset = find_preset(options.preset) if options.preset else usual_preset(field.display.panel_pixels)
    grid, tile = (preset.grid, preset.tile) if preset and not asked else _asked_layout(field, options)
    if max(tile[0] * grid[0], tile[1] * grid[1]) > MOST_SIDE:
        raise LfsrError(f"a quilt of {grid[0]}x{grid[1]} tiles of {tile[0]}×{tile[1]} pixels is over {MOST_SIDE} "
                        "pixels a side: give fewer views or a smaller width")
    return grid, tile


def _asked_layout(field: LightField, options: ExportOptions) -> tuple[Pair, Pair]:
    if options.views and options.views[1] != 1:
        raise LfsrError(f"views are {options.views[0]}x{options.views[1]}, but a quilt has one row of cameras: give "
                        "one number")
    count = options.views[0] if options.views else math.prod(options.grid or (field.count[0],))
    grid = options.grid or _squarest(count, _aspect(field))
    if math.prod(grid) != count:
        raise LfsrError(f"a grid of {grid[0]}x{grid[1]} tiles does not hold just {count} views: choose one that does")
    return grid, field.display.lenses if options.width is None else screen_size(field.display, options.width)


def _quilt(field: LightField, grid: Pair, tile: Pair) -> Array:
    """Quilt (H, W, 3) uint8."""
    columns, rows = grid
    tiles = [resized(view, tile) for view in _row_of_views(field, columns * rows)]
    lines = [np.concatenate(tiles[row * columns:(row + 1) * columns], axis=1) for row in range(rows)]
    return np.concatenate(lines[::-1], axis=0)


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


def _squarest(count: int, aspect: float) -> Pair:
    """Columns and rows of the quilt that is most nearly square, of tiles with this aspect ratio."""
    pairs = [(columns, count // columns) for columns in range(1, count + 1) if count % columns == 0]
    return min(pairs, key=lambda pair: abs(math.log(pair[0] * aspect / pair[1])))
