"""What an eye in front of the display sees: the finished EIA through an ideal lens array.

Millimetres from the centre of the lens array: x rightwards, y upwards, z towards
the viewer; the panel lies one gap behind. Each lens is a pinhole. Lenses are
spaced a little closer than elemental images, so that all send view k to one
place at the viewing distance, where camera k stood.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import flip_order

DEFAULT_WIDTH = 960


def gap_mm(profile: DisplayProfile) -> float:
    """Distance from panel to lenses that gives an elemental image the viewing angle."""
    return profile.lens_pitch_mm[0] / 2 / math.tan(math.radians(profile.viewing_angle_deg) / 2)


def see(eia: Array, profile: DisplayProfile, eye_mm: tuple[float, float, float],
        width: int = DEFAULT_WIDTH) -> Array:
    """What an eye sees of a finished EIA: one sample per lens.

    Outside the viewing zone an eye sees the neighbouring lens's elemental image, as
    on a real array, and black beyond the panel.

    Parameters
    ----------
    eia : (H, W, C) in panel order, as eia.png
    profile : the display
    eye_mm : (x, y, z) of the eye
    width : most pixels across of the result

    Returns
    -------
    (sy·n, sx·n, C) with each sample n times, the largest n that fits ``width``, or 1

    Raises
    ------
    LfsrError : for an eye behind the lenses or an image that is not the profile's
    """
    check_sight(eia, profile, eye_mm)
    if profile.ei_order == "direct":
        # The driver of such a display reverses each EI before the panel shows it.
        eia = flip_order(eia, profile.lenses)
    column, row = _seen_pixel(profile, eye_mm, 0), len(eia) - 1 - _seen_pixel(profile, eye_mm, 1)[::-1]
    return enlarged(_pixels_or_black(eia, row, column), width)


def check_sight(image: Array, profile: DisplayProfile, eye_mm: tuple[float, float, float]) -> None:
    """LfsrError unless ``image`` (H, W, C) has the panel's size and the eye is in front of the lenses."""
    columns, rows = profile.panel_pixels
    if image.shape[:2] != (rows, columns):
        raise LfsrError(f"the panel's image has {image.shape[1]}×{image.shape[0]} pixels, but display "
                        f"{profile.name!r} has {columns}×{rows}: upscale the folder again")
    if eye_mm[2] <= 0:
        raise LfsrError(f"the eye is at z = {eye_mm[2]} mm, but it must be in front of the display, above 0")


def enlarged(picture: Array, width: int) -> Array:
    """A picture (rows, columns, C) with each pixel as many times as fit into ``width``, at least once."""
    times = max(1, width // picture.shape[1])
    return picture.repeat(times, axis=0).repeat(times, axis=1)


def _seen_pixel(profile: DisplayProfile, eye_mm: tuple[float, float, float], axis: int) -> Array:
    """Panel pixel seen through each lens along one axis, counted in the axis's direction; may be off the panel."""
    lenses, length, pixels = profile.lenses[axis], profile.panel_mm[axis], profile.panel_pixels[axis]
    gap, distance = gap_mm(profile), profile.viewing_distance_mm
    ei_center = ((np.arange(lenses) + 0.5) / lenses - 0.5) * length
    lens = ei_center * distance / (distance + gap)
    on_panel = lens + (lens - eye_mm[axis]) * gap / eye_mm[2]
    return np.floor((on_panel / length + 0.5) * pixels).astype(int)


def _pixels_or_black(eia: Array, row: Array, column: Array) -> Array:
    height, width = eia.shape[:2]
    seen = eia[np.clip(row, 0, height - 1)[:, None], np.clip(column, 0, width - 1)]
    seen[(row < 0) | (row >= height)] = 0
    seen[:, (column < 0) | (column >= width)] = 0
    return seen


def seen_views(profile: DisplayProfile, eye_mm: tuple[float, float, float]) -> tuple[Array, Array]:
    """Which view of which lens's elemental image an eye sees through each lens, along each axis on its own.

    Returns
    -------
    Two of (2, lenses) along x, rightwards, and y, downwards: of what is seen through each lens the elemental image,
    below 0 or beyond the last where nothing is, and the view, as ``rays.py`` counts them
    """
    whole = dataclasses.replace(profile, panel_pixels=profile.eia_pixels, lenslet=None, lenticular=None, subpixels=None)
    across, up = _seen_pixel(whole, eye_mm, 0), _seen_pixel(whole, eye_mm, 1)
    pixels = across, whole.panel_pixels[1] - 1 - up[::-1]
    # What lies left of a lens's centre is seen from the right.
    return tuple(np.stack([pixel // count, count - 1 - pixel % count])
                 for pixel, count in zip(pixels, profile.views, strict=True))
