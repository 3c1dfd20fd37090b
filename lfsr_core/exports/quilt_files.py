"""Read quilts of others, images and films, into views."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.exports.quilt_names import QuiltShape, read_quilt_name, usual_aspect
from lfsr_core.exports.retarget import Source
from lfsr_core.exports.view_files import image_size, read_image

# FFmpeg's readers by the ending of a film's name; without one it would also follow playlists to other files.
FILMS = {".mp4": "mov", ".mov": "mov", ".m4v": "mov", ".mkv": "matroska", ".webm": "matroska", ".avi": "avi"}
MOST_SIDE, LEAST_TILE = 16384, 2  # pixels
BT709, UNKNOWN = "ITU709", 2  # a film's colour matrix, and FFmpeg's number for one that it does not say
HIGH_DEFINITION = 720  # rows from which films without a word on it have BT.709


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
    return _assumed(said, top_first) if aspect is None else Quilt(said.grid, aspect, top_first)


def _assumed(said: QuiltShape, top_first: bool) -> Quilt:
    """With the aspect ratio of the display that has such quilts."""
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
