"""The simulated eye: what a viewer in front of the display sees of the panel's image.

Millimetres from the centre of the lens array: x rightwards, y upwards, z towards
the viewer; the panel lies one gap behind. Each lens is a pinhole. Lenses are
spaced a little closer than elemental images, so that every lens sends view k to the
place of camera k at the viewing distance.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import flip_order
from lfsr_core.optics.panel.trace import seen_panel

DEFAULT_WIDTH = 960
Point = tuple[float, float, float]


def gap_mm(profile: DisplayProfile) -> float:
    """Distance from panel to lenses at which an elemental image fills the viewing angle."""
    return profile.lens_pitch_mm[0] / 2 / math.tan(math.radians(profile.viewing_angle_deg) / 2)


def eye_view(panel: Array, profile: DisplayProfile, eye_mm: Point, width: int = DEFAULT_WIDTH) -> Array:
    """Return what an eye sees of the panel's image: about one pixel per lens, black beyond the panel.

    From outside the viewing zone an eye sees the elemental image of a neighbouring lens, as on a real display.

    Parameters
    ----------
    panel : (H, W, C) in panel order, as in eia.png; with a lens sheet (H, W, 3) uint8, as in panel.png
    profile : the display
    eye_mm : (x, y, z) of the eye
    width : most pixels across of the result

    Returns
    -------
    (rows·n, columns·n, C) with each pixel repeated n times, the largest n that fits ``width``, or 1

    Raises
    ------
    LfsrError : if the eye is behind the lenses or the image has another size than the panel
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


def seen_views(profile: DisplayProfile, eye_mm: Point) -> tuple[Array, Array]:
    """Elemental image and view that an eye sees through each lens, along x (rightwards) and y (downwards).

    Each array is (2, lenses): the number of the elemental image, which may lie off the panel, and the view in it,
    counted as in ``rays.py``.
    """
    whole = dataclasses.replace(profile, panel_pixels=profile.eia_pixels, lenslet=None, lenticular=None, subpixels=None)
    across, up = _seen_pixel(whole, eye_mm, 0), _seen_pixel(whole, eye_mm, 1)
    pixels = across, whole.panel_pixels[1] - 1 - up[::-1]
    # An eye on the right sees the pixels left of a lens's centre.
    x, y = (np.stack([pixel // count, count - 1 - pixel % count])
            for pixel, count in zip(pixels, profile.views, strict=True))
    return x, y
