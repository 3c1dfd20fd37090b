"""The EIA: which ray each pixel sends, the lens card that renders these, and the orders of its pixels.

``tests/support/reference_rays.py`` has the ray of each pixel, the reference for ``ray_layout.osl`` and for the card.

Camera-array space is Cycles' camera space: origin at the viewing position, +X right, +Y up, +Z towards the display
plane. The camera plane is z = 0, the display plane (zero parallax) z = distance. Lengths are scene units. Pixel rows
count from the top, raster coordinates (as in OSL) from the bottom.

An EIA has three orders of the same pixels: as it is (H, W, C), as elemental images (sy, sx, py, px, C), as views
(py, px, sy, sx, C). Lens pairs are (horizontal, vertical) counts. View order: pixel k of an EI is view k, left to right
and top to bottom.

A part of an EIA that one of several machines renders is named by its rows of lenses, from 1 at the top; the last row is
included, as in a frame range.
"""

import dataclasses
import math
import re
from collections.abc import Iterable
from typing import Self

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile

CONVENTIONS = ("centred", "paper")
LensList = tuple[tuple[int, int], ...]  # (row, column) pairs
Clip = tuple[float, float]
RIM = 0.01  # pixels by which the card is larger than the image, so that no ray misses it by a rounding error
MIN_SIZE = 1e-3  # least size of the card, as a fraction of the size at which bumps look as through ordinary cameras
UNIT = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], float)  # corners of a quad, rightwards and downwards
Rows = tuple[int, int]  # first and last
RANGE = re.compile(r"(\d{1,9})(?:([-/])(\d{1,9}))?$")
LENSES_PER_BACKGROUND = 8  # one chosen lens in eight is background: it finds foreground that the mask missed
BITS = 16


@dataclasses.dataclass(frozen=True)
class CameraArray:
    """Placement of the dense camera array in scene units."""

    distance: float  # from the camera plane to the display plane
    # half_width, half_height: half the display rectangle
    half_width: float
    half_height: float
    spacing: float  # between neighbouring dense views
    clip: Clip | None = None  # nearest and farthest visible depth from the camera plane, None for no limit

    @classmethod
    def for_display(cls, profile: DisplayProfile, width: float, distance: float | None = None) -> Self:
        """Array of ``profile`` for a display ``width`` scene units wide.

        ``distance``: from the cameras to the display, in scene units; the viewing angle is kept. None for the distance
        at which width and distance have the display's true proportions.
        """
        height = width * profile.panel_mm[1] / profile.panel_mm[0]
        if distance is None:
            distance = width * profile.viewing_distance_mm / profile.panel_mm[0]
        return cls(distance, width / 2, height / 2, profile.camera_spacing_mm * distance / profile.viewing_distance_mm)

    @property
    def half_size(self) -> tuple[float, float]:
        """Half the display rectangle, (horizontal, vertical)."""
        return self.half_width, self.half_height

    @property
    def clip_start(self) -> float:
        """Depth at which rays start."""
        return self.clip[0] if self.clip else 0.0


@dataclasses.dataclass(frozen=True)
class RayLayout:
    """Which ray each pixel of one render sends (paper Eqs. (4)-(8))."""

    # lenses, views: (horizontal, vertical) counts of this render
    lenses: tuple[int, int]
    views: tuple[int, int]
    array: CameraArray  # placement of the dense camera array
    spacing: float  # between the views of this render, s × the dense spacing
    convention: str = "centred"  # one of CONVENTIONS, "centred" unless the paper is reproduced
    # Side of the square of the camera plane that the rays of one view cover, in spacings of
    # finished views: 1 covers one finished view, s all that a rendered view stands for, 0 is a point.
    view_aperture: float = 1.0
    lens_list: LensList | None = None  # only these lenses, in tiles of the image, row by row; None for all
    # axes along which the display's views differ; along the others every ray starts on the array's axis
    parallax: tuple[bool, bool] = (True, True)

    def __post_init__(self) -> None:
        if self.convention not in CONVENTIONS:
            raise LfsrError(f"convention is {self.convention!r}, but it must be one of {', '.join(CONVENTIONS)}")
        most = max(1, self.spacing / self.array.spacing)
        if not 0 <= self.view_aperture <= most * (1 + 1e-9):
            raise LfsrError(f"view aperture is {self.view_aperture}, but it must be between 0 and {most:g}")
        if self.lens_list is not None and not self.lens_list:
            raise LfsrError("the list of lenses is empty: name at least one lens or leave the list out")
        for row, column in self.lens_list or ():
            if not (0 <= row < self.lenses[1] and 0 <= column < self.lenses[0]):
                raise LfsrError(f"lens ({row}, {column}) is outside the {self.lenses[1]} rows and "
                                f"{self.lenses[0]} columns of the display: name lenses inside it")

    @classmethod
    def for_display(cls, profile: DisplayProfile, array: CameraArray, scale: int = 1, *, convention: str = "centred",
                    view_aperture: float = 1.0, lens_list: LensList | None = None) -> Self:
        """Layout of the EIA of ``profile`` with views divided by ``scale``."""
        return cls(profile.lenses, profile.low_views(scale), array, array.spacing * scale, convention, view_aperture,
                   lens_list, profile.parallax)

    @property
    def cell(self) -> tuple[float, float]:
        """Width and height, in scene units, of the part of the camera plane that the rays of one view cover."""
        side = self.array.spacing * self.view_aperture
        return side * self.parallax[0], side * self.parallax[1]

    @property
    def reach(self) -> float:
        """Distance from the array's axis, in scene units, beyond which no ray starts (an upper bound)."""
        return max(self.views) * self.spacing

    @property
    def tiles(self) -> tuple[int, int]:
        """Elemental images across and down the rendered image."""
        if self.lens_list is None:
            return self.lenses
        across = min(len(self.lens_list), max(1, math.isqrt(len(self.lens_list))))
        return across, math.ceil(len(self.lens_list) / across)

    @property
    def shown_lenses(self) -> Array:
        """Row and column on the display of the lens that each tile shows, (rows, columns, 2)."""
        across, down = self.tiles
        if self.lens_list is None:
            return np.moveaxis(np.indices((down, across)), 0, -1)
        # Tiles after the last listed lens repeat it, so that the image is a full rectangle.
        number = np.minimum(np.arange(across * down), len(self.lens_list) - 1).reshape(down, across)
        return np.take(self.lens_list, number, axis=0)

    @property
    def size(self) -> tuple[int, int]:
        """Rendered image size in pixels, (width, height)."""
        return self.tiles[0] * self.views[0], self.tiles[1] * self.views[1]


def view_offset(index: Array, count: int, spacing: float, convention: str = "centred") -> Array:
    """Offset of view ``index`` (from 0) of ``count`` on the camera plane, rightwards positive, in units of ``spacing``.

    Centred: (k + 1/2 - count/2) · spacing. Paper Eqs. (5), (7): (k - ⌊count/2⌋) · spacing.
    """
    return (index - count // 2 if convention == "paper" else index + 0.5 - count / 2) * spacing


@dataclasses.dataclass(frozen=True)
class LensCard:
    """A mesh before an orthographic camera that turns its parallel rays into those of a ray layout.

    Every tile of the image is one quad; the lenses may lie in any lattice. The material computes every pixel's ray from
    what the corners store and from these constants; ``tests/support/card_rays.py`` repeats that. Scene units, +X right,
    +Y up, seen from the camera.
    """

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


def to_elemental_images(eia: Array, lenses: tuple[int, int]) -> Array:
    """(H, W, C) -> (sy, sx, py, px, C), a view of the same memory where possible."""
    px, py = views_per_lens(eia, lenses)
    return eia.reshape(lenses[1], py, lenses[0], px, eia.shape[2]).transpose(0, 2, 1, 3, 4)


def from_elemental_images(elemental_images: Array) -> Array:
    """(sy, sx, py, px, C) -> (H, W, C)."""
    sy, sx, py, px, channels = elemental_images.shape
    return elemental_images.transpose(0, 2, 1, 3, 4).reshape(sy * py, sx * px, channels)


def to_views(eia: Array, lenses: tuple[int, int]) -> Array:
    """(H, W, C) -> sub-aperture images (py, px, sy, sx, C)."""
    return to_elemental_images(eia, lenses).transpose(2, 3, 0, 1, 4)


def from_views(views: Array) -> Array:
    """(py, px, sy, sx, C) -> (H, W, C)."""
    return from_elemental_images(views.transpose(2, 3, 0, 1, 4))


def flip_order(eia: Array, lenses: tuple[int, int]) -> Array:
    """Reverse the pixels inside each EI in both axes: view order <-> panel order behind lenses."""
    return from_elemental_images(to_elemental_images(eia, lenses)[:, :, ::-1, ::-1])


def views_per_lens(eia: Array, lenses: tuple[int, int]) -> tuple[int, int]:
    """(px, py) of an EIA of shape (H, W, C); LfsrError unless lenses divide it."""
    if eia.ndim != 3 or eia.shape[1] % lenses[0] or eia.shape[0] % lenses[1]:
        raise LfsrError(f"image has shape {eia.shape}, expected (rows, columns, channels) with "
                        f"{lenses[1]} rows and {lenses[0]} columns of equal elemental images")
    return eia.shape[1] // lenses[0], eia.shape[0] // lenses[1]


def parse_rows(text: str, count: int) -> Rows:
    """Return the rows that ``text`` names: ``A-B``, one row ``A``, or ``K/N``, the Kth of N nearly equal parts.

    ``count`` is the number of rows of the display. LfsrError if it does not have these rows.
    """
    if (match := RANGE.match(text.strip())) is None:
        raise LfsrError(f"rows are {text[:30]!r}, but they must be A-B, as in 1-{count}, or K/N, as in 1/4")
    first, last = int(match[1]), int(match[3] or match[1])
    if match[2] == "/":
        if not 1 <= first <= last <= count:
            raise LfsrError(f"rows are {text.strip()}, but the display has {count} rows of lenses: give K/N with K "
                            f"from 1 to N, and N at most {count}")
        return (first - 1) * count // last + 1, first * count // last
    check_rows((first, last), count)
    return first, last


def check_rows(rows: Rows, count: int) -> None:
    """LfsrError unless a display with ``count`` rows of lenses has ``rows``."""
    if not 1 <= rows[0] <= rows[1] <= count:
        raise LfsrError(f"rows are {rows[0]}-{rows[1]}, but the display has rows of lenses 1-{count}: give rows "
                        "within these")


def pixel_rows(rows: Rows, height: int) -> tuple[int, int]:
    """First pixel row, and the one after the last, in an EIA with ``height`` pixels per lens."""
    return (rows[0] - 1) * height, rows[1] * height


def check_cover(parts: Iterable[Rows], count: int) -> None:
    """LfsrError unless ``parts``, in any order, cover each of the rows 1 to ``count`` once."""
    at = 0
    for first, last in [*sorted(parts), (count + 1, count)]:
        if first > at + 1:
            raise LfsrError(f"rows {rows_text((at + 1, first - 1))} are in none of the parts: render them with "
                            f"--rows {at + 1}-{first - 1}, or name their folder too")
        if first <= at:
            raise LfsrError(f"rows {rows_text((first, min(last, at)))} are in more than one part: leave one of the "
                            "parts out")
        at = last


def rows_text(rows: Rows) -> str:
    """Rows as in a sentence: "3" or "3-5"."""
    return str(rows[0]) if rows[0] == rows[1] else f"{rows[0]}-{rows[1]}"


def choose_lenses(mask: Array, count: int, seed: int = 0) -> tuple[tuple[int, int], ...]:
    """Return ``count`` different random lenses, (row, column), in reading order.

    ``mask`` (sy, sx) bool is the foreground. One lens in eight is background where there is
    any; of eight or more lenses at least two are, because one alone has no spread. The others
    are foreground. Every lens of a group is equally likely. LfsrError if fewer than ``count`` lenses exist.
    """
    check_count(count, mask.size)
    foreground, background = np.argwhere(mask), np.argwhere(~mask)
    most = max(2, count // LENSES_PER_BACKGROUND) if count >= LENSES_PER_BACKGROUND else 0
    wanted = min(count - min(len(background), most), len(foreground))
    random = np.random.default_rng(seed)
    chosen = np.concatenate([systematic_sample(foreground, wanted, random),
                             systematic_sample(background, count - wanted, random)])
    return tuple(sorted((int(row), int(column)) for row, column in chosen))


def check_count(count: int, lenses: int) -> None:
    """LfsrError unless ``count`` is from 1 to the number of ``lenses`` of a display."""
    if not 1 <= count <= lenses:
        raise LfsrError(f"number of lenses is {str(count)[:20]}, but it must be from 1 to the display's {lenses}")


def systematic_sample(lenses: Array, count: int, random: np.random.Generator) -> Array:
    """Return ``count`` of ``lenses`` (n, 2), row and column, spread evenly: equal steps along a Z-order curve.

    The start is random, so every lens is equally likely.
    """
    bits = (lenses[:, :, None] >> np.arange(BITS)) & 1
    z_order = (bits * 4 ** np.arange(BITS)).sum(-1) @ np.array([2, 1])
    places = (np.arange(count) + random.random()) * (len(lenses) / max(count, 1))
    return np.asarray(lenses[np.argsort(z_order)][np.minimum(places.astype(int), len(lenses) - 1)])
