"""Find and read the views in a folder, by the names that other programs give them."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Progress, Tell, silent
from lfsr_core.images.source import opened
from lfsr_core.optics.display import MAX_PIXELS

MOST_CAMERAS = 65536
MOST_BYTES = 2**35  # of all views together
SEPARATOR, ENDING = "[-_. x]", r"\.(?:png|jpe?g|ppm|tiff?)"
Place = tuple[int, int]  # row from the top, column from the left


@dataclasses.dataclass(frozen=True)
class ViewFiles:
    """A full grid of view files of one size."""

    paths: tuple[tuple[Path, ...], ...]  # rows from the topmost cameras, each from the left
    size: tuple[int, int]  # (width, height) of every view

    @property
    def count(self) -> tuple[int, int]:
        """Cameras (across, down)."""
        return len(self.paths[0]), len(self.paths)

    def square(self, tell: Tell = silent) -> ViewFiles:
        """A single row, or the cameras in the middle, as many down as across; LfsrError for a single column or view."""
        across, down = self.count
        least = min(across, down)
        if across == 1:
            raise LfsrError(f"the folder has {across}×{down} cameras, but a display needs at least two beside each "
                            "other: check the names")
        if down in (across, 1):
            return self
        top, left = (down - least) // 2, (across - least) // 2
        paths = tuple(row[left:left + least] for row in self.paths[top:top + least])
        tell(Notice("cameras-cut", {"side": least, "across": across, "down": down}))
        return dataclasses.replace(self, paths=paths)


def find_views(folder: Path, columns: int | None = None) -> ViewFiles:
    """Find the views in a folder by their names; LfsrError where one is missing or differs in size.

    ``columns``: cameras across, for names that are mere numbers; None: as many as down.
    """
    if not folder.is_dir():
        raise LfsrError(f"{folder} is no folder, expected one of views: check the path")
    names = sorted(path.name for path in folder.iterdir())
    places = _hci(names, columns) or _stanford(names) or _numbered(names)
    if not places:
        raise LfsrError(f"{folder} has no views with known names, such as input_Cam000.png (HCI), "
                        "out_00_00_-1.5_2.5_.png (Stanford), 000_000.ppm (JPEG Pleno) or view_000_000.png (a title, "
                        "row and column): rename them")
    down, across = (range(min(numbers), max(numbers) + 1) for numbers in zip(*places, strict=True))
    if len(down) * len(across) > MOST_CAMERAS:
        raise LfsrError(f"{folder} names {len(across)}×{len(down)} cameras, more than {MOST_CAMERAS}: check the names")
    for row, column in itertools.product(down, across):
        if (row, column) not in places:
            raise LfsrError(f"{folder} has {len(places)} views, but the one in row {row}, column {column} of "
                            f"{len(down)} rows of {len(across)} is missing (another is {min(places.values())}): add "
                            "it, or remove its whole row or column")
    paths = tuple(tuple(folder / places[row, column] for column in across) for row in down)
    first = image_size(paths[0][0])  # from the header
    for path in itertools.chain(*paths):
        if (size := image_size(path)) != first:
            raise LfsrError(f"{path.name} has {size[0]}×{size[1]} pixels, but {paths[0][0].name} has "
                            f"{first[0]}×{first[1]}: all views must have one size")
    if max(first) > MAX_PIXELS or first[0] * first[1] * len(paths) * len(paths[0]) * 3 > MOST_BYTES:
        raise LfsrError(f"{len(paths[0])}×{len(paths)} views of {first[0]}×{first[1]} pixels are too many to import: "
                        "make them smaller")
    return ViewFiles(paths, first)


def read_views(files: ViewFiles, tell: Tell = silent) -> Array:
    """Views (rows, columns, height, width, 3) uint8 display values."""
    (across, down), (width, height) = files.count, files.size
    views = np.empty((down, across, height, width, 3), np.uint8)
    for row, paths in enumerate(files.paths):
        tell(Progress("import", row / down, paths[0].name))
        for column, path in enumerate(paths):
            views[row, column] = read_image(path)
    return views


def _hci(names: list[str], columns: int | None) -> dict[Place, str]:
    found = [(int(match[1]), name) for match, name in _matching(r"input_cam(\d+)", names)]
    columns = columns or math.ceil(math.sqrt(max(found, default=(0,))[0] + 1))
    return _placed((divmod(number, columns), name) for number, name in found)


def _stanford(names: list[str]) -> dict[Place, str]:
    """Files by row and column, reversed where the coordinates in the names fall as these rise."""
    found = _matching(r".*?_?(\d+)_(\d+)_(-?\d+(?:\.\d+)?)_(-?\d+(?:\.\d+)?)_?", names)
    if not found:
        return {}
    rows, columns, y, x = np.array([[float(match[group]) for group in (1, 2, 3, 4)] for match, _ in found]).T
    places = zip(_directed(rows, y), _directed(columns, x), strict=True)
    return _placed(zip(places, (name for _, name in found), strict=True))


def _placed(found: Iterable[tuple[Place, str]]) -> dict[Place, str]:
    """Names by their places; LfsrError where two have the same."""
    places: dict[Place, str] = {}
    for place, name in found:
        if place in places:
            raise LfsrError(f"{places[place]} and {name} belong to the same camera: remove one")
        places[place] = name
    return places


def _directed(numbers: Array, coordinates: Array) -> list[int]:
    """Row or column numbers from 0, reversed where coordinates fall as they rise."""
    falls = np.dot(numbers - numbers.mean(), coordinates - coordinates.mean()) < 0
    return [int(number) for number in (numbers.max() - numbers if falls else numbers - numbers.min())]


def _numbered(names: list[str]) -> dict[Place, str]:
    """Files named by column and row, as in JPEG Pleno, or by a title, row and column, as our exports are."""
    pair = rf"(\d+){SEPARATOR}(\d+)"
    pleno, titled = _matching(pair, names), _matching(rf".*\D{pair}", names)
    return _placed([((int(match[2]), int(match[1])), name) for match, name in pleno]
                   or [((int(match[1]), int(match[2])), name) for match, name in titled])


def _matching(pattern: str, names: list[str]) -> list[tuple[re.Match[str], str]]:
    """Names of images that match a pattern and an ending, in small or capital letters."""
    whole = re.compile(pattern + ENDING, re.IGNORECASE)
    return [(match, name) for name in names if (match := whole.fullmatch(name))]


def image_size(path: Path) -> tuple[int, int]:
    with opened(path) as source:
        if source is None:
            oiio.geterror()
            raise LfsrError(f"{path} is no readable image: replace it")
        return source.spec().width, source.spec().height


def read_image(path: Path) -> Array:
    """(height, width, 3) uint8."""
    with opened(path) as source:
        pixels = source.read_image("uint8") if source else None
        # A JPEG that was cut short is read, its rest grey. Extraneous bytes, which some cameras write, change nothing.
        if source and source.has_error and "extraneous" not in source.geterror():
            pixels = None
    if pixels is None:
        oiio.geterror()
        raise LfsrError(f"{path} is damaged: replace it")
    pixels = np.asarray(pixels).reshape(*pixels.shape[:2], -1)
    return pixels[..., :3] if pixels.shape[2] >= 3 else pixels[..., :1].repeat(3, axis=2)
