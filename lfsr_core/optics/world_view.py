"""The world behind the scene, as every pixel of a light field sees it, from one image of it.

Light from infinitely far away depends only on a ray's direction, and all rays of a camera array point into one cone.
The image is an ordinary perspective one, whose pixels are equal steps of a ray's slope (sideways per unit of
depth). The rays of a pixel cover a lens and a cell of views: their slopes are those between the two centres, blurred
by two boxes.
"""

import dataclasses
import functools
import math
from typing import Self

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.rays import RayLayout, view_offset

PER_PIXEL = 6  # pixels of the image across what a pixel of the light field sees
MIN_SIDE, MAX_SIDE = 16, 4096  # pixels of the image along an axis
MARGIN = 2  # of its pixels, beyond what is seen
# Sum of the squared widths of boxes by which the image's own pixels (one of 1) and linear lookup (two more) blur.
OWN_BLUR = 3.0


@dataclasses.dataclass(frozen=True)
class WorldImage:
    """Extent of an image of the world for one light field; pairs are (horizontal, vertical)."""

    size: tuple[int, int]  # pixels
    reach: tuple[float, float]  # slope of its edges, both ways from the array's axis

    @classmethod
    def of(cls, layout: RayLayout) -> Self:
        """The image that contains every ray of ``layout``."""
        extents = []
        for axis in (0, 1):
            boxes = _boxes(layout, axis)
            edge = max(float(np.abs(slopes(layout, axis)).max()) + sum(boxes) / 2, 1e-6)
            count = min(max(2 * math.ceil(edge / (max(boxes) / PER_PIXEL) + MARGIN), MIN_SIDE), MAX_SIDE)
            extents.append((count, edge * count / (count - 2 * MARGIN)))
        (width, reach_x), (height, reach_y) = extents
        return cls((width, height), (reach_x, reach_y))

    @property
    def step(self) -> tuple[float, float]:
        """Slope from pixel to pixel."""
        return 2 * self.reach[0] / self.size[0], 2 * self.reach[1] / self.size[1]


@dataclasses.dataclass(frozen=True)
class WorldView:
    """What the lenses of a light field see of the world."""

    layout: RayLayout  # every view of the display
    image: WorldImage
    pixels: Array  # (H, W, 3) of the image, float32, blurred as the layout's pixels see it

    @classmethod
    def of(cls, layout: RayLayout, pixels: Array) -> Self:
        """The world through ``layout``, from the rendered ``pixels`` (H, W, 3) of its image."""
        image = WorldImage.of(layout)
        down, across = (_blur(image.size[axis], [width / image.step[axis] for width in _boxes(layout, axis)])
                        for axis in (1, 0))
        rows = down @ np.asarray(pixels, float).reshape(image.size[1], -1)
        blurred = np.einsum("hwc,xw->hxc", rows.reshape(image.size[1], -1, 3), across, optimize=True)
        return cls(layout, image, np.maximum(blurred, 0).astype(np.float32))

    def elemental_images(self, lenses: Array) -> Array:
        """The world, (N, py, px, 3) scene-linear, as seen by ``lenses`` (N, 2), row and column on the display."""
        lenses, (px, py) = np.asarray(lenses), self.layout.views
        images = np.empty((len(lenses), py, px, 3), np.float32)
        columns, parts = self._places[0]
        for row in np.unique(lenses[:, 0]):
            chosen = lenses[:, 0] == row
            first, part = columns[lenses[chosen, 1]], parts[lenses[chosen, 1], :, None]
            above, below = (values[row] for values in self._places[1])
            # (py, W, 3): the image at the heights that this row of lenses sees.
            seen = self.pixels[above] + below[:, None, None] * (self.pixels[above + 1] - self.pixels[above])
            left = seen[:, first]
            images[chosen] = np.moveaxis(left + part * (seen[:, first + 1] - left), 0, 1)
        return images

    @functools.cached_property
    def _places(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Along each axis, the image's pixel below every (lens, view), and how far past its centre, in pixels."""
        places = []
        for axis in (0, 1):
            last = self.image.size[axis] - 1
            at = np.clip(slopes(self.layout, axis) / self.image.step[axis] + last / 2, 0, last)
            first = np.minimum(at.astype(int), last - 1)
            places.append((first, (at - first).astype(np.float32)))
        return places[0], places[1]


def slopes(layout: RayLayout, axis: int) -> Array:
    """Slope of the middle ray of every (lens, view) of the display along an axis, rightwards or downwards positive."""
    lenses, views, half = layout.lenses[axis], layout.views[axis], layout.array.half_size[axis]
    lens, view = np.arange(lenses)[:, None], np.arange(views)
    place = (lens * views + view + 0.5) / views if layout.convention == "paper" else lens + 0.5
    steps: Array = (place / lenses * 2 - 1) * half - view_offset(view, views, layout.spacing, layout.convention)
    return np.divide(steps, layout.array.distance)


def _boxes(layout: RayLayout, axis: int) -> tuple[float, float]:
    """Widths, in slope, of a lens and of a view's cell."""
    paper = layout.convention == "paper"
    lens = 2 * layout.array.half_size[axis] / layout.lenses[axis] / (layout.views[axis] if paper else 1)
    return lens / layout.array.distance, (0.0 if paper else layout.cell[axis]) / layout.array.distance


def _blur(size: int, widths: list[float]) -> Array:
    """Matrix (size, size) that blurs by boxes of ``widths`` pixels in turn, less the blur that the image has."""
    widths = sorted(widths)
    widths[-1] = math.sqrt(max(widths[-1] ** 2 - OWN_BLUR, 0))
    blur = np.eye(size)
    for width in (width for width in widths if width > 1):
        # The mean over so many pixels around each; beyond the edge the last pixel repeats.
        middles, reach, box = np.arange(size), math.ceil(width / 2) + 1, np.zeros((size, size))
        for offset in range(-reach, reach + 1):
            low, high = max(-width / 2, offset - 0.5), min(width / 2, offset + 0.5)
            if high > low:
                box[middles, np.clip(middles + offset, 0, size - 1)] += (high - low) / width
        blur = blur @ box
    return blur
