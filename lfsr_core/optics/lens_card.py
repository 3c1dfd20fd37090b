"""The lens card: a mesh before an orthographic camera that turns its parallel rays into those of a ray layout.

Every tile of the image is one quad. A quad stores where its views begin (``cells``, a UV map that counts views
from its upper left corner) and where its lens lies on the display plane (``targets``). From these two the card's
material computes every pixel's ray, for any lattice of lenses: ``tests/support/card_rays.py`` repeats it, and
``rays.py`` is the reference.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.rays import RayLayout, view_offset

RIM = 0.01  # pixels by which the card is larger than the image, so that no ray misses it by a rounding error
MIN_SIZE = 1e-3  # of the card, as a fraction of the one on which bumps look as through other cameras
UNIT = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], float)  # corners of a quad, rightwards and downwards


@dataclasses.dataclass(frozen=True)
class LensCard:
    """Quads and the material's constants; scene units, +X right, +Y up, seen from the camera."""

    pixel: float  # side of a pixel on the card
    corners: Array  # (quads, 4, 2) around the card's centre: upper left, lower left, lower right, upper right
    cells: Array  # (quads, 4, 2) views from the upper left, rightwards and downwards
    targets: Array  # (quads, 2) display-plane point of the first place of a lens
    lens_step: tuple[float, float]  # from the first to the last place of a lens, or of one of its views ("paper")
    first_view: tuple[float, float]  # place of view 0 on the camera plane
    view_step: tuple[float, float]  # from view to view
    aperture: tuple[float, float]  # size of the cell that a view's rays start in
    place_in_pixel: bool  # whether the place inside the pixel, not inside the tile, chooses the point on the lens

    @property
    def spreads(self) -> bool:
        """Whether a pixel's rays start at different places."""
        return any(self.aperture)


def lens_card(layout: RayLayout, radius: float = math.inf) -> LensCard:
    """Return the card of ``layout``, within ``radius`` of its centre if every view of every lens is rendered.

    A pixel is as large as a lens on the display plane if the radius allows it. Then the footprint of a ray, by which
    Cycles filters bumps and dices surfaces, is that of a camera at a view, and the same at every scale.
    """
    array, paper = layout.array, layout.convention == "paper"
    pitch = np.array([2 * array.half_width / layout.lenses[0], -2 * array.half_height / layout.lenses[1]])
    views, up = np.array(layout.views), np.array([1, -1])
    first = np.array([view_offset(np.array(0), n, layout.spacing, layout.convention) for n in layout.views])
    # Pixels from the centre of the whole panel to its corner.
    scale = layout.spacing / array.spacing
    every = (count * (scale if moves else 1) for count, moves in zip(layout.views, layout.parallax, strict=True))
    reach = math.hypot(*(lenses * count / 2 for lenses, count in zip(layout.lenses, every, strict=True)))
    pixel = float(pitch[0] * min(1, max(MIN_SIZE, radius / reach / pitch[0])))
    rows, columns = np.divmod(np.arange(layout.tiles[0] * layout.tiles[1]), layout.tiles[0])
    tiles = np.stack([columns, rows], axis=-1)
    # Corners (quads, 4, 2) in pixels from the image's upper left corner, rightwards and downwards.
    places = (tiles[:, None] + UNIT) * layout.views
    places = places + RIM * ((places == layout.size).astype(float) - (places == 0))
    return LensCard(
        pixel=pixel, corners=(places - np.array(layout.size) / 2) * (1, -1) * pixel,
        cells=places - tiles[:, None] * views,
        targets=layout.shown_lenses.reshape(-1, 2)[:, ::-1] * pitch - up * array.half_size,
        lens_step=_pair(pitch / views if paper else pitch), first_view=_pair(first * up),
        view_step=_pair(layout.spacing * up),
        aperture=(0.0, 0.0) if paper else _pair(np.multiply(layout.cell, up)), place_in_pixel=not paper)


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])
