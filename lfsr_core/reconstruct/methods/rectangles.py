"""Rectangles of lenses for the denoiser: the wanted lenses and some around them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.arrays import Array

CONTEXT = 32  # pixels around the wanted ones that the denoiser sees too
POOLED = 16  # pixels that the denoiser's network pools into one

Box = tuple[slice, slice]  # rows and columns of lenses


@dataclasses.dataclass(frozen=True)
class Rectangle:
    """Wanted lenses (``inner``), and the same with those around that the denoiser sees too (``outer``)."""

    inner: Box
    outer: Box

    @property
    def crop(self) -> Box:
        """Rows and columns of ``inner`` in an array of ``outer``."""
        rows, columns = (slice(part.start - around.start, part.stop - around.start)
                         for part, around in zip(self.inner, self.outer, strict=True))
        return rows, columns


def span(wanted: Array, pixels: int) -> slice:
    """Span of the (n,) wanted lenses, of ``pixels`` each, with CONTEXT around; it may be empty.

    It starts on a multiple of POOLED pixels, so that the denoiser pools as in the whole image.
    """
    places = np.flatnonzero(wanted)
    return _around(slice(places[0], places[-1] + 1), pixels, len(wanted)) if len(places) else slice(0, 0)


def rectangles(wanted: Array, views: tuple[int, int]) -> list[Rectangle]:
    """Rectangles that hold every ``wanted`` lens (sy, sx), of (h, w) ``views``, far enough apart to be independent.

    Rows and columns without wanted lenses separate them where they are wide enough to save work.
    """
    gaps = [2 * math.ceil(CONTEXT / pixels) for pixels in views]
    (sy, sx), (h, w) = wanted.shape, views
    boxes = _separated(wanted, (slice(0, sy), slice(0, sx)), gaps)
    return [Rectangle((rows, columns), (_around(rows, h, sy), _around(columns, w, sx))) for rows, columns in boxes]


def _around(part: slice, pixels: int, count: int) -> slice:
    around, step = math.ceil(CONTEXT / pixels), POOLED // math.gcd(POOLED, pixels)
    return slice(max(part.start - around, 0) // step * step, min(part.stop + around, count))


def _separated(wanted: Array, box: Box, gaps: list[int]) -> list[Box]:
    """Boxes inside ``box`` by a recursive X-Y cut (Nagy and Seth, ICPR 1984)."""
    runs = [_runs(wanted[box].any(1 - axis), gaps[axis], box[axis].start) for axis in (0, 1)]
    parts = [(rows, columns) for rows in runs[0] for columns in runs[1]]
    if len(parts) < 2:
        return parts
    return [found for part in parts for found in _separated(wanted, part, gaps)]


def _runs(wanted: Array, gap: int, start: int) -> list[slice]:
    """Runs of wanted entries, from index ``start`` on, separated by more than ``gap`` others."""
    places = np.flatnonzero(wanted)
    pieces = np.split(places, np.flatnonzero(np.diff(places) > gap + 1) + 1) if len(places) else []
    return [slice(start + int(piece[0]), start + int(piece[-1]) + 1) for piece in pieces]
