"""The simulated eye: what a viewer in front of the display sees of the panel's image.

Millimetres from the centre of the lens array: x rightwards, y upwards, z towards the viewer; the panel lies one gap
behind. Each lens is a pinhole. Lenses are spaced a little closer than elemental images, so that every lens sends view k
to the place of camera k at the viewing distance.

An eye's card shows the same in a viewport: a lens card on which every lens of the display shows the view that the eye
sees. Its rays are those of the rendered views, with one colour per lens, and it costs one pixel per lens.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.trace import seen_panel
from lfsr_core.optics.rays import LensCard, RayLayout, flip_order, lens_card

Point = tuple[float, float, float]
PIXEL_SIZES = (8, 4, 2, 1)  # of a viewport
MIN_FILLED = 0.8  # fraction of the region, below which smaller pixels are used
INSIDE = 1 - 1e-3  # of a cell, so that no rounding leads to the next view
ROUNDING = 1e-6
Pair = tuple[int, int]


def gap_mm(profile: DisplayProfile) -> float:
    """Distance from panel to lenses at which an elemental image fills the viewing angle."""
    return profile.lens_pitch_mm[0] / 2 / math.tan(math.radians(profile.viewing_angle_deg) / 2)


def eye_view(panel: Array, profile: DisplayProfile, eye_mm: Point, width: int = 960) -> Array:
    """Return what an eye sees of the panel's image: about one pixel per lens, black beyond the panel.

    From outside the viewing zone an eye sees the elemental image of a neighbouring lens, as on a real display.
    ``panel``: (H, W, C) in panel order, as in eia.png; with a lens sheet (H, W, 3) uint8, as in panel.png; ``eye_mm``:
    (x, y, z) of the eye. Returns (rows·n, columns·n, C) with each pixel repeated n times, the largest n that fits
    ``width`` pixels, or 1. LfsrError if the eye is behind the lenses or the image has another size than the panel.
    """
    columns, rows = profile.panel_pixels
    if panel.shape[:2] != (rows, columns):
        raise LfsrError(f"the panel's image has {panel.shape[1]}×{panel.shape[0]} pixels, but display "
                        f"{profile.name!r} has {columns}×{rows}: upscale the folder again")
    if eye_mm[2] <= 0:
        raise LfsrError(f"the eye is at z = {eye_mm[2]} mm, but it must be in front of the display, above 0")
    if profile.is_woven:
        seen = seen_panel(panel, profile, eye_mm)
    else:
        # The driver of a "direct" display reverses each elemental image before the panel shows it.
        eia = flip_order(panel, profile.lenses) if profile.ei_order == "direct" else panel
        column, row = _seen_pixel(profile, eye_mm, 0), rows - 1 - _seen_pixel(profile, eye_mm, 1)[::-1]
        seen = eia[np.clip(row, 0, rows - 1)[:, None], np.clip(column, 0, columns - 1)]
        seen[(row < 0) | (row >= rows)] = 0
        seen[:, (column < 0) | (column >= columns)] = 0
    times = max(1, width // seen.shape[1])
    return seen.repeat(times, axis=0).repeat(times, axis=1)


def _seen_pixel(profile: DisplayProfile, eye_mm: Point, axis: int) -> Array:
    """Panel pixel seen through each lens along one axis, counted in the axis's direction; may be off the panel."""
    lenses, length, pixels = profile.lenses[axis], profile.panel_mm[axis], profile.panel_pixels[axis]
    gap, distance = gap_mm(profile), profile.viewing_distance_mm
    ei_center = ((np.arange(lenses) + 0.5) / lenses - 0.5) * length
    lens = ei_center * distance / (distance + gap)
    on_panel = lens + (lens - eye_mm[axis]) * gap / eye_mm[2]
    pixel: Array = np.floor((on_panel / length + 0.5) * pixels).astype(int)
    return pixel


@dataclasses.dataclass(frozen=True)
class LiveRegion:
    """A region of the screen that shows a panel, or its middle; pairs are (horizontal, vertical) in pixels."""

    profile: DisplayProfile
    size: Pair  # of the region
    scale: int  # a rendered pixel covers scale × scale pixels of the region, from its lower left corner on

    @property
    def drawn(self) -> Pair:
        """Size of the part of the region, from its lower left corner, that whole rendered pixels fill."""
        return self.size[0] // self.scale * self.scale, self.size[1] // self.scale * self.scale

    @property
    def corner(self) -> Pair:
        """Lower left corner of the panel, in pixels from that of the region; below 0 if the panel is larger.

        A multiple of ``scale``, so that each rendered pixel is one view of one lens.
        """
        left, bottom = ((drawn - pixels) // (2 * self.scale) * self.scale
                        for drawn, pixels in zip(self.drawn, self.profile.panel_pixels, strict=True))
        return left, bottom

    @property
    def shift(self) -> tuple[float, float]:
        """Pixels from the region's centre to the panel's, rightwards and upwards."""
        across, up = (self.corner[axis] + (self.profile.panel_pixels[axis] - self.size[axis]) / 2 for axis in (0, 1))
        return across, up

    def sentence(self) -> str | None:
        """What is wrong with the region and what to do; None if nothing is."""
        (width, height), (wide, high) = self.size, self.profile.panel_pixels
        if (width, height) == (wide, high):
            return None
        found = f"the live window shows {width}×{height} pixels, but display {self.profile.name!r} has {wide}×{high}"
        if self.drawn != self.size:
            return (f"{found}, and its sides are not multiples of the pixel size {self.scale}, so that views mix: make "
                    "the window full screen on the display, or change its size")
        if width >= wide and height >= high:
            return f"{found}: the image is in the middle of a border; make the window full screen on the display"
        return (f"{found}: a centred part is shown; drag the window to the display, make it full screen, and set that "
                "screen's scaling to 100 % and its resolution to the panel's")


def eye_place(profile: DisplayProfile, right: float, up: float, near: float) -> Point:
    """Millimetres from the display's centre of an eye.

    ``right`` and ``up`` are fractions of half the viewing zone (-1 to 1 inside it), ``near`` of the viewing distance.
    """
    across, high = (count * profile.camera_spacing_mm / 2 for count in profile.views)
    return right * across, up * high, near * profile.viewing_distance_mm


def eye_region(profile: DisplayProfile, size: tuple[int, int]) -> LiveRegion:
    """Return a region of ``size`` in which each lens is a rectangle of whole pixels; LfsrError if it is too small."""
    pitch_x, pitch_y = profile.lens_pitch_mm
    most = min(length / lenses / side for length, lenses, side in zip(
        size, profile.lenses, profile.lens_pitch_mm, strict=True))
    for pixel in PIXEL_SIZES:
        sides = (pixel * math.floor(most * pitch_x / pixel + ROUNDING),
                 pixel * math.floor(most * pitch_y / pixel + ROUNDING))
        if min(sides) > 0 and (pixel == 1 or min(sides) >= MIN_FILLED * most * min(pitch_x, pitch_y)):
            pixels = sides[0] * profile.lenses[0], sides[1] * profile.lenses[1]
            plain = dataclasses.replace(profile, views=sides, panel_pixels=pixels, panel_mm=pixels, lenslet=None,
                                        lenticular=None, subpixels=None)
            return LiveRegion(plain, size, pixel)
    raise LfsrError(f"the eye's window shows {size[0]}×{size[1]} pixels, but display {profile.name!r} has "
                    f"{profile.lenses[0]}×{profile.lenses[1]} lenses: make the window larger")


def eye_card(layout: RayLayout, profile: DisplayProfile, eye_mm: Point, region: LiveRegion,
             radius: float = math.inf) -> LensCard:
    """Return the lens card that shows the rendered views of ``layout`` to an eye.

    ``eye_mm``: (x, y, z) from the middle of the lens array, towards the viewer. ``region``: from ``eye_region``.
    ``radius``: as in ``lens_card``.
    """
    times_x, times_y = (side // region.scale for side in region.profile.views)
    lenses = layout.lenses[0] * times_x, layout.lenses[1] * times_y
    fine = lens_card(dataclasses.replace(layout, lenses=lenses, views=(1, 1)), radius)
    # Pixels that the eye sees through each lens, rightwards and downwards, which may lie off the panel.
    plain = dataclasses.replace(profile, panel_pixels=profile.eia_pixels, lenslet=None, lenticular=None, subpixels=None)
    across, up = _seen_pixel(plain, eye_mm, 0), _seen_pixel(plain, eye_mm, 1)
    # Per axis (lenses · times, 2): the elemental image, and the rendered view, counted as in ``rays.py``. An eye on the
    # right sees the pixels left of a lens's centre.
    columns, rows = (np.repeat([pixel // count, (count - 1 - pixel % count) * rendered // count], times, axis=1).T
                     for pixel, count, rendered, times in zip(
                         (across, plain.panel_pixels[1] - 1 - up[::-1]), profile.views, layout.views,
                         (times_x, times_y), strict=True))
    grid = np.stack(np.broadcast_arrays(columns[None], rows[:, None]), axis=-1)  # row, column, image or view, axis
    image, view = grid.reshape(-1, 2, 2).swapaxes(0, 1)
    shown = ((image >= 0) & (image < layout.lenses)).all(1)
    cells = view[:, None] + 0.5 + INSIDE * (np.clip(fine.cells, 0, 1) - 0.5)
    whole = lens_card(layout, radius)
    targets = np.clip(image, 0, np.array(layout.lenses) - 1) * np.array(whole.lens_step) + whole.targets[0]
    return dataclasses.replace(whole, pixel=fine.pixel, corners=fine.corners[shown], cells=cells[shown],
                               targets=targets[shown])
