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
from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.base.notices import Progress
from lfsr_core.exports.films import ANIMATION_RATE, write_film
from lfsr_core.exports.light_field import LightField, resized, screen_size
from lfsr_core.exports.options import PRESETS, QUILT_FILM_TYPES, ExportOptions, Pair, Preset, chosen_type, quilt_name
from lfsr_core.images.png import write_png

MOST_SIDE = 16384  # pixels; no program takes more


def write_quilt(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one quilt."""
    grid, tile = _layout(field, options)
    write_png(folder / f"{quilt_name(field.name, grid, _aspect(field))}.png", _quilt(field, grid, tile))


def write_quilt_film(fields: Iterator[LightField], count: int | None, folder: Path, options: ExportOptions) -> None:
    """Write ``count`` quilts as a film, None for one, of even sides, as its encoders need."""
    first = next(fields)
    grid, (width, height) = _layout(first, options)
    tile = width - width * grid[0] % 2, height - height * grid[1] % 2
    name = f"{quilt_name(first.name, grid, _aspect(first))}.{chosen_type(options, QUILT_FILM_TYPES)}"

    def quilts() -> Iterator[Array]:
        for number, field in enumerate(itertools.chain([first], fields)):
            options.tell(Progress("export", number / (count or 1), f"frame {number + 1} of {count or 1}"))
            yield _quilt(field, grid, tile)

    write_film(folder / name, quilts(), options.fps or ANIMATION_RATE)


def _aspect(field: LightField) -> float:
    return field.display.panel_mm[0] / field.display.panel_mm[1]


def _layout(field: LightField, options: ExportOptions) -> tuple[Pair, Pair]:
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
        grid = options.grid or min(pairs, key=lambda pair: abs(math.log(pair[0] * _aspect(field) / pair[1])))
        if math.prod(grid) != count:
            raise LfsrError(f"a grid of {grid[0]}x{grid[1]} tiles does not hold just {count} views: choose one that "
                            "does")
        tile = field.display.lenses if options.width is None else screen_size(field.display, options.width)
    if max(tile[0] * grid[0], tile[1] * grid[1]) > MOST_SIDE:
        raise LfsrError(f"a quilt of {grid[0]}x{grid[1]} tiles of {tile[0]}×{tile[1]} pixels is over {MOST_SIDE} "
                        "pixels a side: give fewer views or a smaller width")
    return grid, tile


def _quilt(field: LightField, grid: Pair, tile: Pair) -> Array:
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
