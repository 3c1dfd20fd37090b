"""The lens card: a mesh before an orthographic camera that turns its parallel rays into those of a ray layout.

Every tile of the image is one quad. A quad carries where its views begin (``cells``, a UV map that counts views
from its upper left corner) and where its lens lies on the display plane (``targets``). With these two, the same few
sums give every pixel's ray (``card_rays``, what the card's material computes), whatever the lattice of lenses:
other lattices need other quads only. It follows ``rays.py``, which stays the reference.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.rays import RayLayout, view_offset

RIM = 0.01  # pixels by which the card is larger than the image: no ray may miss it by a rounding error
LEAST_SIZE = 1e-3  # of the card, as a share of the one that shows bumps as other cameras do


@dataclasses.dataclass(frozen=True)
class LensCard:
    """Quads, and what the material adds to them; scene units, +X right, +Y up, seen from the camera."""

    pixel: float  # side of a pixel on the card
    corners: Array  # (quads, 4, 2) around the card's centre: upper left, lower left, lower right, upper right
    cells: Array  # (quads, 4, 2) views from the upper left, rightwards and downwards
    targets: Array  # (quads, 2) display-plane point that the first place of a lens is sent to
    lens_step: tuple[float, float]  # from the first to the last place of a lens, or of one view of it ("paper")
    first_view: tuple[float, float]  # place of view 0 on the camera plane
    view_step: tuple[float, float]  # from view to view
    aperture: tuple[float, float]  # size of the cell that a view's rays start in
    place_in_pixel: bool  # whether the place inside the pixel chooses the point on the lens, or that inside the tile

    @property
    def size(self) -> Array:
        """(width, height)."""
        return self.corners.reshape(-1, 2).max(0) - self.corners.reshape(-1, 2).min(0)


def lens_card(layout: RayLayout, radius: float = math.inf) -> LensCard:
    """The card of ``layout``, no farther than ``radius`` from its centre where every view of every lens is rendered.

    A pixel is as large as a lens on the display plane where the radius allows it: so the footprint of a ray, by which
    Cycles filters bumps and dices surfaces, is that of a camera at a view, and the same at every scale.
    """
    array, paper = layout.array, layout.convention == "paper"
    pitch = np.array([2 * array.half_width / layout.lenses[0], -2 * array.half_height / layout.lenses[1]])
    views, up = np.array(layout.views), np.array([1, -1])
    first = [float(view_offset(np.array(0), count, layout.spacing, layout.convention)) for count in layout.views]
    pixel = float(pitch[0] * min(1, max(LEAST_SIZE, radius / _reach(layout) / pitch[0])))
    return LensCard(
        pixel=pixel, corners=_corners(layout) * pixel, cells=_places(layout) - _tiles(layout)[:, None] * views,
        targets=_lenses(layout) * pitch - up * (array.half_width, array.half_height),
        lens_step=_pair(pitch / views if paper else pitch), first_view=_pair(first * up),
        view_step=_pair(layout.spacing * up),
        aperture=_pair((0, 0) if paper else layout.cell * up), place_in_pixel=not paper)


def card_rays(card: LensCard, cells: Array, targets: Array, distance: float,
              random: Array | float = 0.5) -> tuple[Array, Array]:
    """What the material computes, in camera-array space.

    Parameters
    ----------
    card : the constants
    cells, targets : (..., 2) at the points of the card that are asked for
    distance : of the display plane
    random : (..., 2) in [0, 1), the point in the view's cell

    Returns
    -------
    Origins and unit directions, (..., 3) each
    """
    views = np.floor(cells)
    place = cells - views if card.place_in_pixel else cells
    jitter = np.multiply(card.aperture, np.asarray(random) - 0.5)
    start = card.first_view + views * card.view_step + jitter
    end = targets + place * card.lens_step
    depth = np.full((*start.shape[:-1], 1), float(distance))
    direction = np.concatenate([end - start, depth], axis=-1)
    origin = np.concatenate([start, np.zeros_like(depth)], axis=-1)
    return origin, direction / np.linalg.norm(direction, axis=-1, keepdims=True)


# Corners of a quad, rightwards and downwards.
_UNIT = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], float)


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _reach(layout: RayLayout) -> float:
    """Pixels from the centre of the whole panel to its corner."""
    scale = layout.spacing / layout.array.spacing
    every = (views * (scale if moves else 1) for views, moves in zip(layout.views, layout.parallax, strict=True))
    return math.hypot(*(lenses * views / 2 for lenses, views in zip(layout.lenses, every, strict=True)))


def _count(layout: RayLayout) -> int:
    return layout.tiles[0] * layout.tiles[1]


def _tiles(layout: RayLayout) -> Array:
    """(quads, 2) column and row of every tile, row by row."""
    rows, columns = np.divmod(np.arange(_count(layout)), layout.tiles[0])
    return np.stack([columns, rows], axis=-1)


def _lenses(layout: RayLayout) -> Array:
    """(quads, 2) column and row of every tile's lens; those after the last listed lens repeat it."""
    if layout.lens_list is None:
        return _tiles(layout)
    listed = np.asarray(layout.lens_list)[:, ::-1]
    return listed[np.minimum(np.arange(_count(layout)), len(listed) - 1)]


def _places(layout: RayLayout) -> Array:
    """(quads, 4, 2) corners in pixels, rightwards and downwards from the image's upper left one, the rim with them."""
    places = (_tiles(layout)[:, None] + _UNIT) * layout.views
    return places + RIM * ((places == layout.size).astype(float) - (places == 0))


def _corners(layout: RayLayout) -> Array:
    """(quads, 4, 2) in pixels from the image's centre, Y up."""
    return (_places(layout) - np.array(layout.size) / 2) * (1, -1)
