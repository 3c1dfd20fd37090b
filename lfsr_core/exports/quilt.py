"""Quilts: views side by side in one image, for Looking Glass displays and their programs; and to read those of others.

Tile 0 is at the bottom left and holds the leftmost camera's view; tiles go rightwards, then upwards. The name holds
columns, rows and the panel's proportions: ``name_qs8x6a0.75.png``.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Progress
from lfsr_core.exports.films import ANIMATION_RATE, write_film
from lfsr_core.exports.light_field import LightField, Source, resized, screen_size
from lfsr_core.exports.options import QUILT_FILM_TYPES, ExportOptions, chosen_type
from lfsr_core.exports.quilt_names import Pair, find_preset, quilt_name, read_quilt_name, usual_aspect, usual_preset
from lfsr_core.exports.view_files import image_size, read_image
from lfsr_core.images.png import write_png

# FFmpeg's readers by the ending of a film's name; without one it would also follow playlists to other files.
FILMS = {".mp4": "mov", ".mov": "mov", ".m4v": "mov", ".mkv": "matroska", ".webm": "matroska", ".avi": "avi"}
MOST_SIDE, LEAST_TILE = 16384, 2  # pixels; no program takes more
BT709, UNKNOWN = "ITU709", 2  # a film's colour matrix, and FFmpeg's number for one that it does not say
HIGH_DEFINITION = 720  # rows from which films without a word on it have BT.709


def write_quilt(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one quilt."""
    grid, tile = _layout(field, options)
    write_png(folder / f"{quilt_name(field.name, grid, _aspect(field))}.png", _quilt(field, grid, tile))


def write_quilt_film(fields: Iterator[LightField], count: int, folder: Path, options: ExportOptions) -> None:
    """Write ``count`` quilts as a film, of even sides, as its encoders need."""
    first = next(fields)
    grid, (width, height) = _layout(first, options)
    tile = width - width * grid[0] % 2, height - height * grid[1] % 2
    name = f"{quilt_name(first.name, grid, _aspect(first))}.{chosen_type(options, QUILT_FILM_TYPES)}"

    def quilts() -> Iterator[Array]:
        for number, field in enumerate(itertools.chain([first], fields)):
            options.tell(Progress("export", number / count, f"frame {number + 1} of {count}"))
            yield _quilt(field, grid, tile)

    write_film(folder / name, quilts(), options.fps or ANIMATION_RATE)


def _aspect(field: LightField) -> float:
    return field.display.panel_mm[0] / field.display.panel_mm[1]


def _layout(field: LightField, options: ExportOptions) -> tuple[Pair, Pair]:
    """Tiles and their pixels: as asked for, the preset of the display's panel, or all views of a display without."""
    asked = options.views or options.grid or options.width
    if options.preset and asked:
        raise LfsrError(f"preset {options.preset!r} decides views, grid and width of a quilt: leave these out")
    preset = find_preset(options.preset) if options.preset else usual_preset(field.display.panel_pixels)
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


@dataclasses.dataclass(frozen=True)
class Quilt:
    """How to read a quilt."""

    grid: tuple[int, int]  # tiles across and down
    aspect: float  # of the picture, width / height
    top_first: bool = False  # whether tile 0 is at the top left, as in quilts for CubeVi's display
    assumed: Notice | None = None  # that its name had no aspect ratio


def is_film(path: Path) -> bool:
    """Whether a file's name is that of a film."""
    return path.suffix.lower() in FILMS


def quilt_of(path: Path, shape: str | None = None, top_first: bool = False) -> Quilt:
    """How to read the quilt in ``path``, by ``shape``, as 8x6 or 8x6a0.75, else by its name; LfsrError for neither."""
    said = read_quilt_name(f"_qs{shape}" if shape is not None else path.stem)
    if said is None or (shape is not None and not re.fullmatch(r"[\dxa.]+", shape, re.IGNORECASE)):
        if shape is not None:
            raise LfsrError(f"quilt is {shape[:30]!r}, but it must be tiles across and down, and perhaps the aspect "
                            "ratio, as 8x6 or 8x6a0.75")
        raise LfsrError(f"the name {path.name} does not say how many tiles the quilt has, as name_qs8x6a0.75.png does: "
                        "give --quilt, as 8x6 or 8x6a0.75")
    if said.grid[0] * said.grid[1] < 2:
        raise LfsrError(f"a quilt of {said.grid[0]}x{said.grid[1]} tiles has no two views: give --quilt, as 8x6")
    named = read_quilt_name(path.stem)
    aspect = said.aspect or (named.aspect if named else None)
    if aspect is not None:
        return Quilt(said.grid, aspect, top_first)
    aspect, (across, down) = usual_aspect(said.grid), said.grid
    if aspect is None:
        raise LfsrError(f"the aspect ratio of a quilt of {across}x{down} tiles is not known: give --quilt with it, as "
                        f"{across}x{down}a0.75")
    return Quilt(said.grid, aspect, top_first,
                 Notice("aspect-assumed", {"across": across, "down": down, "aspect": aspect}))


def read_quilt(path: Path, quilt: Quilt) -> Source:
    """Views of a quilt that is an image; LfsrError where it cannot be read or is too large or too small."""
    _check_size(path, image_size(path), quilt)
    return Source(_tiles(read_image(path), quilt), quilt.aspect, equal_angles=True)


def read_film(path: Path, quilt: Quilt) -> Iterator[tuple[Source, int]]:
    """Views of each frame of a film of quilts, and the film's number of frames, 0 if not known; LfsrError as above."""
    try:
        import av
    except ImportError:
        raise LfsrError("films need the package av, which this Python lacks: pip install 'lfsr[video]', or import "
                        "single images") from None
    try:
        with av.open(str(path), format=FILMS[path.suffix.lower()], metadata_errors="replace") as film:
            stream = next((stream for stream in film.streams.video if stream.codec_context), None)
            if stream is None:
                raise LfsrError(f"{path} has no images that can be read: give a film of quilts")
            _check_size(path, (stream.width, stream.height), quilt)
            for frame in film.decode(stream):
                _check_size(path, (frame.width, frame.height), quilt)
                matrix = BT709 if frame.colorspace == UNKNOWN and frame.height >= HIGH_DEFINITION else None
                pixels = frame.reformat(format="rgb24", src_colorspace=matrix).to_ndarray()
                yield Source(_tiles(pixels, quilt), quilt.aspect, equal_angles=True), stream.frames
    except av.FFmpegError as error:
        raise LfsrError(f"{path} is no readable film ({error.strerror}): replace it") from None


def _check_size(path: Path, size: tuple[int, int], quilt: Quilt) -> None:
    if max(size) > MOST_SIDE:
        raise LfsrError(f"{path} has {size[0]}×{size[1]} pixels, but a quilt has at most {MOST_SIDE} a side: make it "
                        "smaller")
    if any(pixels < LEAST_TILE * tiles for pixels, tiles in zip(size, quilt.grid, strict=True)):
        raise LfsrError(f"{path} has {size[0]}×{size[1]} pixels, too few for {quilt.grid[0]}x{quilt.grid[1]} tiles: "
                        "give the right --quilt")


def _tiles(pixels: Array, quilt: Quilt) -> Array:
    """Views (1, n, height, width, 3), the leftmost first, of a quilt (H, W, 3) uint8.

    Where the grid does not divide the size, tiles begin at the nearest pixel.
    """
    (columns, rows), (high, wide) = quilt.grid, pixels.shape[:2]
    width, height = wide // columns, high // rows
    left = [min(round(column * wide / columns), wide - width) for column in range(columns)]
    top = [min(round(row * high / rows), high - height) for row in range(rows)]
    lines = top if quilt.top_first else top[::-1]
    views: Array = np.stack([pixels[y:y + height, x:x + width] for y in lines for x in left])[None]
    return views
