"""The light field as one eye sees it, as a lens card: every lens of the display shows the one view that the eye sees.

The rays are those of the rendered views, so the picture is the light field decoded, in as many colours as there are
lenses, and costs that many pixels.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import seen_views
from lfsr_core.optics.lens_card import LensCard, lens_card
from lfsr_core.optics.live_region import LiveRegion
from lfsr_core.optics.rays import RayLayout

PIXEL_SIZES = (8, 4, 2, 1)   # of a viewport
LEAST_FILLED = 0.8   # of the region, before smaller pixels are taken
INSIDE = 1 - 1e-3    # of a cell, so that no rounding leads to the next view
ROUNDING = 1e-6

Place = tuple[float, float, float]


def eye_place(profile: DisplayProfile, right: float, up: float, near: float) -> Place:
    """Millimetres from the display's middle of an eye at shares of the viewing zone (-1 to 1 inside it) and of
    the viewing distance."""
    across, high = (count * profile.camera_spacing_mm / 2 for count in profile.views)
    return right * across, up * high, near * profile.viewing_distance_mm


def eye_region(profile: DisplayProfile, size: tuple[int, int]) -> LiveRegion:
    """A region of ``size`` in which every lens is a rectangle of whole pixels; LfsrError where it is too small."""
    pitch = profile.lens_pitch_mm
    most = min(length / lenses / side for length, lenses, side in zip(size, profile.lenses, pitch, strict=True))
    for pixel in PIXEL_SIZES:
        sides = tuple(pixel * math.floor(most * side / pixel + ROUNDING) for side in pitch)
        if min(sides) > 0 and (pixel == 1 or min(sides) >= LEAST_FILLED * most * min(pitch)):
            pixels = sides[0] * profile.lenses[0], sides[1] * profile.lenses[1]
            plain = dataclasses.replace(profile, views=sides, panel_pixels=pixels, panel_mm=pixels, lenslet=None,
                                        lenticular=None, subpixels=None)
            return LiveRegion(plain, size, pixel)
    raise LfsrError(f"the eye's window shows {size[0]}×{size[1]} pixels, but display {profile.name!r} has "
                    f"{profile.lenses[0]}×{profile.lenses[1]} lenses: make the window larger")


def eye_card(layout: RayLayout, profile: DisplayProfile, eye_mm: Place, region: LiveRegion,
             radius: float = math.inf) -> LensCard:
    """The card of ``region`` for an eye.

    Parameters
    ----------
    layout : the rendered views
    profile : the display
    eye_mm : (x, y, z) from the middle of the lens array, towards the viewer
    region : of ``eye_region``
    radius : as of ``lens_card``
    """
    fold = tuple(side // region.scale for side in region.profile.views)
    lenses = tuple(count * times for count, times in zip(layout.lenses, fold, strict=True))
    fine = lens_card(dataclasses.replace(layout, lenses=lenses, views=(1, 1)), radius)
    image, view = _seen(profile, layout, eye_mm, fold)
    shown = ((image >= 0) & (image < layout.lenses)).all(1)
    cells = view[:, None] + 0.5 + INSIDE * (np.clip(fine.cells, 0, 1) - 0.5)
    whole = lens_card(layout, radius)
    targets = np.clip(image, 0, np.array(layout.lenses) - 1) * np.array(whole.lens_step) + whole.targets[0]
    return dataclasses.replace(whole, pixel=fine.pixel, corners=fine.corners[shown], cells=cells[shown],
                               targets=targets[shown])


def _seen(profile: DisplayProfile, layout: RayLayout, eye_mm: Place,
          fold: tuple[int, int]) -> tuple[Array, Array]:
    """(tiles, 2) elemental image and rendered view of every tile, row by row; a lens is ``fold`` tiles."""
    axes = [np.repeat([image, view * layout.views[axis] // profile.views[axis]], fold[axis], axis=1)
            for axis, (image, view) in enumerate(seen_views(profile, eye_mm))]
    columns, rows = (axis.T for axis in axes)
    grid = np.stack(np.broadcast_arrays(columns[None], rows[:, None]), axis=-1)   # row, column, image or view, axis
    flat = grid.reshape(-1, 2, 2)
    return flat[:, 0], flat[:, 1]
