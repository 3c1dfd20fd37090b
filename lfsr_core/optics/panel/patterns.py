"""Test patterns that show, by eye or in a photograph, how a lens sheet lies on a panel.

``phase``: fringes, slightly more than one per lens, so that an eye sees one fringe over several lenses, and dots as
landmarks; ``fit.py`` measures a sheet by them. ``lens``: all pixels behind one lens in LENS_STEP, the others dark.
``band``: only the middle view, so that the panel is white from the middle of the viewing zone and dark from elsewhere.
``rgb``: the left third of the views red, the middle third green, the right third blue. ``grid``: the borders of the
elemental images.
"""

from __future__ import annotations

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import (
    Geometry,
    elemental_lattice,
    lattice_coordinates,
    nearest_point,
    subpixel_places,
    subpixel_rays,
)
from lfsr_core.optics.sheet import Lenslet, Lenticular

PATTERNS = ("phase", "lens", "band", "rgb", "grid")
LENS_STEP = 8
BORDER = 0.12  # of a lens pitch
MIN_CARRIER, MAX_CARRIER, FRINGES = 4, 16, 12
DOTS = (7, 4)  # across, down
DOT_LEVELS = 0.3, 1.0
MIN_DOT_LENSES = 1.5


def pattern(profile: DisplayProfile, kind: str) -> Array:
    """Return the panel's image (H, W, 3) uint8 of one of PATTERNS.

    LfsrError for another name, or a display without a lens sheet.
    """
    if kind not in PATTERNS:
        raise LfsrError(f"pattern is {kind!r}, but it must be one of {', '.join(PATTERNS)}")
    columns, rows = profile.panel_pixels
    image = np.empty((rows, columns, 3), np.uint8)
    paint = {"phase": _phase, "lens": _lens, "band": _band, "rgb": _rgb, "grid": _grid}[kind]
    across = np.arange(columns)
    for start in range(0, rows, 128):
        part = np.arange(start, min(start + 128, rows))
        for channel in range(3):
            image[part, :, channel] = np.rint(255 * paint(profile, channel, part[:, None], across))
    return image


def carrier(profile: DisplayProfile) -> int:
    """Lenses that one fringe of the phase pattern spans for an eye, if the profile is right."""
    sheet = profile.sheet
    lenses = (sheet.lenses_across(profile.panel_mm[0]) if isinstance(sheet, Lenticular)
              else min(profile.panel_mm) / max(sheet.pitches))
    return int(np.clip(lenses / FRINGES, MIN_CARRIER, MAX_CARRIER))


def dots(profile: DisplayProfile) -> tuple[Array, float]:
    """Centres (n, 2) of the phase pattern's dots, millimetres from the panel's, y up, and their standard deviation."""
    places = [((np.arange(count) + 0.5) / count - 0.5) * size for count, size
              in zip(DOTS, profile.panel_mm, strict=True)]
    spread = max(MIN_DOT_LENSES * max(profile.sheet.pitches), profile.panel_mm[0] / DOTS[0] / 9)
    return np.stack(np.meshgrid(*places), -1).reshape(-1, 2), spread


def _phase(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    x, y = subpixel_places(profile, channel, rows, columns)
    if channel == 2:
        centers, spread = dots(profile)
        across, up = (np.exp(-0.5 * ((place[..., None] - np.unique(axis)) / spread) ** 2).sum(-1)
                      for place, axis in zip(np.broadcast_arrays(x, y), centers.T, strict=True))
        light: Array = DOT_LEVELS[0] + (DOT_LEVELS[1] - DOT_LEVELS[0]) * np.minimum(across * up, 1)
        return light
    light = 0.5 + 0.5 * np.cos(2 * np.pi * (1 + 1 / carrier(profile)) * lattice_coordinates(profile, x, y)[channel])
    return light


def _lens(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    place, sheet = subpixel_places(profile, channel, rows, columns), profile.sheet
    if isinstance(sheet, Lenslet):
        first, second = nearest_point(elemental_lattice(sheet, Geometry.of(profile)), sheet.packing, *place)
    else:
        first, second = (np.floor(number + 0.5) for number in lattice_coordinates(profile, *place))
    return np.asarray((first % LENS_STEP == 0) & (second % LENS_STEP == 0), float)


def _band(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    rays = subpixel_rays(profile, channel, rows, columns)
    across, down = (np.abs(view - (count - 1) / 2) for view, count
                    in zip((rays.view_x, rays.view_y), profile.views, strict=True))
    # At least as wide as a pixel, or there would be gaps.
    widths = [max(1.0, count / size) for count, size in zip(profile.views, _pixels_behind(profile), strict=True)]
    return np.asarray(np.broadcast_to((across <= widths[0] / 2) & (down <= widths[1] / 2), across.shape), float)


def _pixels_behind(profile: DisplayProfile) -> tuple[float, float]:
    """Pixels behind a lens, across and down."""
    sheet = profile.sheet
    if isinstance(sheet, Lenticular):
        return profile.panel_pixels[0] / sheet.lenses_across(profile.panel_mm[0]), 1.0
    pixel = profile.panel_mm[0] / profile.panel_pixels[0]
    return sheet.lenses.pitch_mm[0] / pixel, sheet.lenses.pitch_mm[1] / pixel


def _rgb(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    view = (subpixel_rays(profile, channel, rows, columns).view_x + 0.5) / profile.views[0]
    return np.asarray(np.clip(np.floor(view * 3), 0, 2) == channel, float)


def _grid(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    coordinates = lattice_coordinates(profile, *subpixel_places(profile, channel, rows, columns))
    across, up = (np.abs(number - np.floor(number) - 0.5) < BORDER for number in coordinates)
    return np.asarray(across | up if profile.lenslet else across, float)
