"""Images that show how a lens sheet lies on a panel, by eye or in a photograph.

``phase``: fringes of slightly more than one per lens, of which an eye sees one over CARRIER lenses, and dots that say
where; ``fit.py`` measures a sheet by them. ``lens``: every pixel behind one lens in LENS_STEP, the others dark.
``band``: the middle view alone: white all over from the middle of the viewing zone, dark from elsewhere. ``rgb``: the
left third of the views red, the middle one green, the right one blue. ``grid``: the borders of the elemental images.
"""

from __future__ import annotations

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import (
    elemental_lattice,
    lattice_coordinates,
    nearest_point,
    subpixel_places,
    subpixel_rays,
)

PATTERNS = ("phase", "lens", "band", "rgb", "grid")
LENS_STEP = 8
BORDER = 0.12  # of a lens pitch
MOST_CARRIER, LEAST_CARRIER, FRINGES = 16, 4, 12
DOTS = (7, 4)  # across, down
DOT_LEVELS = 0.3, 1.0
LEAST_DOT_LENSES = 1.5


def pattern(profile: DisplayProfile, kind: str) -> Array:
    """The panel's image (H, W, 3) uint8 of one of PATTERNS.

    LfsrError for another word, or a profile without a lens sheet to look at.
    """
    if kind not in PATTERNS:
        raise LfsrError(f"pattern is {kind!r}, but it must be one of {', '.join(PATTERNS)}")
    if not profile.is_woven:
        raise LfsrError(f"display {profile.name!r} has no lens sheet to calibrate: give a profile of format 2 with a "
                        "table lenslet or lenticular")
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
    """Lenses that one fringe of the phase pattern spans for an eye where the profile is right."""
    size = profile.panel_mm[0]
    lenses = profile.lenticular.lenses_across(size) if profile.lenticular else (
        min(profile.panel_mm) / max(profile.lenslet.lenses.pitch_mm))
    return int(np.clip(lenses / FRINGES, LEAST_CARRIER, MOST_CARRIER))


def dots(profile: DisplayProfile) -> tuple[Array, float]:
    """(n, 2) millimetres from the panel's centre, y up, of the phase pattern's dots, and their standard deviation."""
    places = [((np.arange(count) + 0.5) / count - 0.5) * size for count, size
              in zip(DOTS, profile.panel_mm, strict=True)]
    pitch = profile.lenticular.pitch_mm if profile.lenticular else max(profile.lenslet.lenses.pitch_mm)
    spread = max(LEAST_DOT_LENSES * pitch, profile.panel_mm[0] / DOTS[0] / 9)
    return np.stack(np.meshgrid(*places), -1).reshape(-1, 2), spread


def _phase(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    x, y = subpixel_places(profile, channel, rows, columns)
    if channel == 2:
        centers, spread = dots(profile)
        across, up = (np.exp(-0.5 * ((place[..., None] - np.unique(axis)) / spread) ** 2).sum(-1)
                      for place, axis in zip(np.broadcast_arrays(x, y), centers.T, strict=True))
        return DOT_LEVELS[0] + (DOT_LEVELS[1] - DOT_LEVELS[0]) * np.minimum(across * up, 1)
    coordinate = lattice_coordinates(profile, x, y)[channel]
    return 0.5 + 0.5 * np.cos(2 * np.pi * (1 + 1 / carrier(profile)) * coordinate)


def _lens(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    place = subpixel_places(profile, channel, rows, columns)
    if profile.lenslet:
        first, second = nearest_point(elemental_lattice(profile), profile.lenslet.packing, *place)
    else:
        first, second = (np.floor(number + 0.5) for number in lattice_coordinates(profile, *place))
    return ((first % LENS_STEP == 0) & (second % LENS_STEP == 0)).astype(float)


def _band(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    rays = subpixel_rays(profile, channel, rows, columns)
    across, down = (np.abs(view - (count - 1) / 2) for view, count
                    in zip((rays.view_x, rays.view_y), profile.views, strict=True))
    # At least as wide as a subpixel, or there would be gaps.
    widths = [max(1.0, count / size) for count, size in zip(profile.views, _pixels_behind(profile), strict=True)]
    return np.broadcast_to((across <= widths[0] / 2) & (down <= widths[1] / 2), across.shape).astype(float)


def _pixels_behind(profile: DisplayProfile) -> tuple[float, float]:
    if profile.lenticular:
        return profile.panel_pixels[0] / profile.lenticular.lenses_across(profile.panel_mm[0]), 1.0
    pixel = profile.panel_mm[0] / profile.panel_pixels[0]
    across, down = (pitch / pixel for pitch in profile.lenslet.lenses.pitch_mm)
    return across, down


def _rgb(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    view = (subpixel_rays(profile, channel, rows, columns).view_x + 0.5) / profile.views[0]
    return (np.clip(np.floor(view * 3), 0, 2) == channel).astype(float)


def _grid(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> Array:
    coordinates = lattice_coordinates(profile, *subpixel_places(profile, channel, rows, columns))
    edges = [np.abs(number - np.floor(number) - 0.5) < BORDER for number in coordinates]
    return np.logical_or(*np.broadcast_arrays(*edges)).astype(float) if profile.lenslet else edges[0].astype(float)
