"""The world behind everything, as every pixel of a light field sees it: from one picture of it.

What is infinitely far away depends on a ray's direction alone, and all rays of a camera array point into one cone.
The picture is an ordinary perspective one, whose pixels are equal steps of a ray's slope, sideways per unit of
depth. A pixel's rays cover a lens and a cell of views: its slopes are those of their middles, blurred by two boxes.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.rays import RayLayout, view_offset

PER_PIXEL = 6      # steps of the picture across what a pixel of the light field sees
LEAST, MOST = 16, 4096      # pixels of the picture along an axis
MARGIN = 2         # of its pixels, beyond what is seen
# Pixels squared that the picture's own pixels (a box of 1) and looking it up linearly (two more) blur by.
OWN_BLUR = 3.0


@dataclasses.dataclass(frozen=True)
class WorldImage:
    """Where a picture of the world for one light field lies; pairs are (horizontal, vertical)."""

    size: tuple[int, int]  # pixels
    reach: tuple[float, float]  # slope of its edges, both ways from the array's axis

    @classmethod
    def of(cls, layout: RayLayout) -> WorldImage:
        """The picture that holds every ray of ``layout``."""
        edges = [max(abs(slopes(layout, axis)).max() + sum(_boxes(layout, axis)) / 2, 1e-6) for axis in (0, 1)]
        steps = [max(_boxes(layout, axis)) / PER_PIXEL for axis in (0, 1)]
        size = [min(max(2 * math.ceil(edge / step + MARGIN), LEAST), MOST)
                for edge, step in zip(edges, steps, strict=True)]
        reach = [edge * count / (count - 2 * MARGIN) for edge, count in zip(edges, size, strict=True)]
        return cls(tuple(size), tuple(reach))

    @property
    def step(self) -> tuple[float, float]:
        """Slope from pixel to pixel."""
        return 2 * self.reach[0] / self.size[0], 2 * self.reach[1] / self.size[1]

    @property
    def aspect(self) -> float:
        """Height of a pixel by its width."""
        return self.step[1] / self.step[0]


@dataclasses.dataclass(frozen=True)
class WorldView:
    """What a light field sees of the world, by lens."""

    layout: RayLayout  # every view of the display
    picture: WorldImage
    pixels: Array  # (H, W, 3) of the picture, float32, blurred as the layout's pixels see it

    @classmethod
    def of(cls, layout: RayLayout, pixels: Array) -> WorldView:
        """View through ``layout`` of the rendered ``pixels`` (H, W, 3) of its picture."""
        picture = WorldImage.of(layout)
        down, across = (_blur(picture.size[axis], [width / picture.step[axis] for width in _boxes(layout, axis)])
                        for axis in (1, 0))
        rows = down @ np.asarray(pixels, float).reshape(picture.size[1], -1)
        blurred = np.einsum("hwc,xw->hxc", rows.reshape(picture.size[1], -1, 3), across, optimize=True)
        return cls(layout, picture, np.maximum(blurred, 0).astype(np.float32))

    def elemental_images(self, lenses: Array) -> Array:
        """What ``lenses`` (N, 2), row and column on the display, see of the world: (N, py, px, 3) scene-linear."""
        lenses, (px, py) = np.asarray(lenses), self.layout.views
        images = np.empty((len(lenses), py, px, 3), np.float32)
        for row in np.unique(lenses[:, 0]):
            chosen = lenses[:, 0] == row
            first, part = self._places[0][lenses[chosen, 1]], self._places[1][lenses[chosen, 1], :, None]
            seen = self._row(int(row))
            left = seen[:, first]
            images[chosen] = np.moveaxis(left + part * (seen[:, first + 1] - left), 0, 1)
        return images

    def _row(self, row: int) -> Array:
        """(py, W, 3): the picture at the heights that one row of lenses looks at."""
        first, part = (values[row] for values in self._heights)
        return self.pixels[first] + part[:, None, None] * (self.pixels[first + 1] - self.pixels[first])

    @functools.cached_property
    def _places(self) -> tuple[Array, Array]:
        return self._at(0)

    @functools.cached_property
    def _heights(self) -> tuple[Array, Array]:
        return self._at(1)

    def _at(self, axis: int) -> tuple[Array, Array]:
        """Pixel of the picture below every (lens, view) and how far past its middle, in pixels."""
        at = slopes(self.layout, axis) / self.picture.step[axis] + (self.picture.size[axis] - 1) / 2
        at = np.clip(at, 0, self.picture.size[axis] - 1)
        first = np.minimum(at.astype(int), self.picture.size[axis] - 2)
        return first, (at - first).astype(np.float32)


def slopes(layout: RayLayout, axis: int) -> Array:
    """Slope of the middle ray of every (lens, view) of the display along an axis, rightwards or downwards positive."""
    lenses, views = layout.lenses[axis], layout.views[axis]
    half = (layout.array.half_width, layout.array.half_height)[axis]
    lens, view = np.arange(lenses)[:, None], np.arange(views)
    place = (lens * views + view + 0.5) / views if layout.convention == "paper" else lens + 0.5
    target = (place / lenses * 2 - 1) * half
    return (target - view_offset(view, views, layout.spacing, layout.convention)) / layout.array.distance


def _boxes(layout: RayLayout, axis: int) -> tuple[float, float]:
    """Slopes that the points of a lens, and those of a view's cell, cover."""
    half = (layout.array.half_width, layout.array.half_height)[axis]
    paper = layout.convention == "paper"
    lens = 2 * half / layout.lenses[axis] / (layout.views[axis] if paper else 1)
    return lens / layout.array.distance, (0.0 if paper else layout.cell[axis]) / layout.array.distance


def _blur(size: int, widths: list[float]) -> Array:
    """Matrix (size, size) of boxes of so many pixels one after the other, less what the picture is blurred already."""
    widths = sorted(widths)
    widths[-1] = math.sqrt(max(widths[-1] ** 2 - OWN_BLUR, 0))
    return functools.reduce(np.matmul, (_box(size, width) for width in widths))


def _box(size: int, width: float) -> Array:
    """Matrix of the mean over ``width`` pixels around each; beyond the edge the last one repeats."""
    if width <= 1:
        return np.eye(size)
    middles, reach = np.arange(size), math.ceil(width / 2) + 1
    matrix = np.zeros((size, size))
    for offset in range(-reach, reach + 1):
        low, high = max(-width / 2, offset - 0.5), min(width / 2, offset + 0.5)
        if high > low:
            matrix[middles, np.clip(middles + offset, 0, size - 1)] += (high - low) / width
    return matrix
