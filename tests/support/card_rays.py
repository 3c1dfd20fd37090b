"""The rays of a lens card and of a panel card, as their materials in Blender compute them."""

from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.panel.panel_card import PARTS, Linear, PanelCard, Rows
from lfsr_core.optics.panel.subpixel_rays import PERIOD
from lfsr_core.optics.rays import RIM, LensCard, RayLayout
from tests.support.reference_rays import directed, rays

Precision = type[np.floating[Any]]


def lens_card_rays(card: LensCard, cells: Array, targets: Array, distance: float,
                   random: Array | float = 0.5) -> tuple[Array, Array]:
    """Rays of points of a lens card: origins and unit directions, (..., 3) each.

    ``cells``, ``targets``: (..., 2) at these points. ``distance``: of the display plane. ``random``: (..., 2) in
    [0, 1), the point in the view's cell.
    """
    views = np.floor(cells)
    place = cells - views if card.place_in_pixel else cells
    start = card.first_view + views * card.view_step + np.multiply(card.aperture, np.asarray(random) - 0.5)
    end, depth = targets + place * card.lens_step, np.full((*start.shape[:-1], 1), float(distance))
    direction = np.concatenate([end - start, depth], axis=-1)
    origin = np.concatenate([start, np.zeros_like(depth)], axis=-1)
    return origin, direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def panel_card_rays(card: PanelCard, across: Array, up: Array, distance: float,
                    random: tuple[Array, Array] | None = None,
                    precision: Precision = np.float64) -> tuple[Array, Array]:
    """Rays of points of a panel card: origins and unit directions, (..., 3) each.

    ``across``, ``up``: places in the image from 0 to 1, from its left and lower edge. ``distance``: of the display
    plane. ``random``: two numbers in [0, 1), the point on the lens; None for its middle.
    """
    at = _Places(card, np.asarray(across), np.asarray(up), precision)
    away = nearest(at.linear(card.counts), card.images)
    start = at.linear(card.starts) + _times(card.start_steps, away, precision)
    way = at.linear(card.ways) + _times(card.way_steps, away, precision)
    if random is not None:
        point = nearest(np.stack(random, -1).astype(precision) - precision(0.5), card.lenses)
        way = way + _times(card.lens_steps, point, precision)
    (from_x, from_y), (to_x, to_y) = (np.moveaxis(values, -1, 0) for values in (start, start + way))
    return directed((from_x, from_y), (to_x, to_y), distance)


def nearest(counts: Array, rows: Rows) -> Array:
    """How far counts (..., 2) are from the lattice point nearest to them, in counts."""
    across, up = counts[..., 0], counts[..., 1]
    if not rows.shift:
        return np.stack([_wrapped(across), _wrapped(up)], -1)
    shift, square = across.dtype.type(rows.shift), across.dtype.type(rows.square)
    below = np.floor(up)
    inside, first = up - below, _wrapped(across - shift * below)
    second = _wrapped(first - shift)
    above = (second * second - first * first < square * (2 * inside - 1)).astype(across.dtype)
    return np.stack([first + above * (second - first), inside - above], -1)


def _wrapped(values: Array) -> Array:
    """``values`` less the whole number nearest to them, from -0.5 to 0.5."""
    wrapped: Array = values - np.floor(values + values.dtype.type(0.5))
    return wrapped


def _times(matrix: Array, values: Array, precision: Precision) -> Array:
    rounded = matrix.astype(precision)
    product: Array = values[..., :1] * rounded[:, 0] + values[..., 1:] * rounded[:, 1]
    return product


class _Places:
    """Interpolates over the quad, in one precision, as a renderer between the corners of a triangle."""

    def __init__(self, card: PanelCard, across: Array, up: Array, precision: Precision) -> None:
        # The quad is larger than the image by a rim.
        whole = np.abs(card.corners[2] - card.corners[0]) / card.pixel
        places = np.stack(np.broadcast_arrays(across, up), -1)
        self.places, self.precision = ((places * (whole - 2 * RIM) + RIM) / whole).astype(precision), precision
        self.off: Array | None = None
        if card.stretch is not None:
            at = self._corners(card.places)
            column, row = np.moveaxis(np.floor(at).astype(int), -1, 0)
            entry = card.table[row % PERIOD, column % (PERIOD * PARTS), :2].astype(precision)
            self.off = (at - np.floor(at)) * np.array(card.stretch, precision) + entry

    def linear(self, quantity: Linear) -> Array:
        """``quantity`` where the light of the places comes from."""
        values = self._corners(quantity.corners)
        return values if self.off is None else values + _times(quantity.per_pixel, self.off, self.precision)

    def _corners(self, values: Array) -> Array:
        upper_left, lower_left, lower_right, _ = values.astype(self.precision)
        across, up = self.places[..., :1], self.places[..., 1:]
        mixed: Array = (1 - across - up) * lower_left + across * lower_right + up * upper_left
        return mixed


def pixel_rays(layout: RayLayout, place: tuple[float, float] = (0.5, 0.5)) -> tuple[Array, Array]:
    """Origins and unit directions, (H, W, 3), of a ray per pixel, at a ``place`` rightwards and downwards in it."""
    width, height = layout.size
    raster_x, raster_y = np.meshgrid((np.arange(width) + place[0]) / width, 1 - (np.arange(height) + place[1]) / height)
    return rays(layout, raster_x, raster_y)
