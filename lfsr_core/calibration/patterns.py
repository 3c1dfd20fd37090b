"""Test patterns that show, by eye or in a photograph, how a lens sheet lies on a panel.

``phase``: fringes, slightly more than one per lens, so that an eye sees one fringe over several lenses, and light and
dark dots as landmarks, arranged so that no turn and no mirror maps them onto themselves; ``fit.py`` measures a sheet by
them. ``lens``: all pixels behind one lens in LENS_STEP, the others dark. ``band``: only the middle view, so that the
panel is white from the middle of the viewing zone and dark from elsewhere. ``rgb``: the left third of the views red,
the middle third green, the right third blue. ``grid``: the borders of the elemental images.
"""

import dataclasses

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile, Lenslet, Lenticular
from lfsr_core.optics.panel.subpixel_rays import (
    Geometry,
    elemental_lattice,
    lattice_coordinates,
    nearest_point,
    subpixel_places,
    subpixel_rays,
)

PATTERNS = ("phase", "lens", "band", "rgb", "grid")
LENS_STEP = 8
BORDER = 0.12  # of a lens pitch
# Dots are green, which JPEG keeps best; fringes are red and blue.
DOT_CHANNEL, FRINGE_CHANNELS = 1, (0, 2)
MIN_CARRIER, MAX_CARRIER, FRINGES = 5, 28, 12
FINER = 0.75  # second carrier / first: where a wrong profile reverses the fringes, the two tones disagree
MOST_DOTS, DOT_LENSES = 13, 7.5  # dots along the longer side; least lenses from one to the next
DOT_SPREAD = 1 / 6  # standard deviation of a dot, of the distance to the next
DOT_LIGHT, DOT_CONTRAST = 0.55, 0.4
# Which dots are light, a bit each in rows of MOST_DOTS: of 14,000 codes the least like itself when turned or mirrored.
CODE = 0x37195674488f1899f0879d50d4b8b55ec6d0adb571


def pattern(profile: DisplayProfile, kind: str) -> Array:
    """Return the panel's image (H, W, 3) uint8 of one of PATTERNS.

    LfsrError for another name, or a display without a lens sheet.
    """
    if kind not in PATTERNS:
        raise LfsrError(f"pattern is {kind!r}, but it must be one of {', '.join(PATTERNS)}")
    columns, rows = profile.panel_pixels
    image, across = np.empty((rows, columns, 3), np.uint8), np.arange(columns)
    for start in range(0, rows, 128):
        part = np.arange(start, min(start + 128, rows))
        for channel in range(3):
            image[part, :, channel] = np.rint(255 * _painted(profile, kind, channel, part[:, None], across))
    return image


def _painted(profile: DisplayProfile, kind: str, channel: int, rows: Array, columns: Array) -> Array:
    """Values from 0 to 1 of one channel of a pattern in these rows (n, 1) and columns (m,)."""
    sheet = profile.sheet
    if kind in ("rgb", "band"):
        rays = subpixel_rays(profile, channel, rows, columns)
        if kind == "rgb":
            view = (rays.view_x + 0.5) / profile.views[0]
            return np.asarray(np.clip(np.floor(view * 3), 0, 2) == channel, float)
        across, down = (np.abs(view - (count - 1) / 2) for view, count
                        in zip((rays.view_x, rays.view_y), profile.views, strict=True))
        pixel = profile.panel_mm[0] / profile.panel_pixels[0]
        behind = ((profile.panel_pixels[0] / sheet.lenses_across(profile.panel_mm[0]), 1.0)
                  if isinstance(sheet, Lenticular) else (sheet.pitches[0] / pixel, sheet.pitches[1] / pixel))
        # At least as wide as a pixel, or there would be gaps.
        widths = [max(1.0, count / size) for count, size in zip(profile.views, behind, strict=True)]
        return np.asarray(np.broadcast_to((across <= widths[0] / 2) & (down <= widths[1] / 2), across.shape), float)
    x, y = subpixel_places(profile, channel, rows, columns)
    if kind == "phase":
        if channel == DOT_CHANNEL:
            return dots(profile).shown(x, y)
        x, y = np.broadcast_arrays(x, y)
        places, used = lattice_coordinates(profile, x, y), tones(profile, channel)
        waves = [np.cos(2 * np.pi * (1 + 1 / lenses) * places[axis]) for axis, lenses in used]
        return np.asarray(0.5 + 0.44 * sum(waves) / len(waves))
    if kind == "grid":
        across, up = (np.abs(number - np.floor(number) - 0.5) < BORDER for number in lattice_coordinates(profile, x, y))
        return np.asarray(across | up if profile.lenslet else across, float)
    if isinstance(sheet, Lenslet):
        first, second = nearest_point(elemental_lattice(sheet, Geometry.of(profile)), sheet.packing, x, y)
    else:
        first, second = (np.floor(number + 0.5) for number in lattice_coordinates(profile, x, y))
    return np.asarray((first % LENS_STEP == 0) & (second % LENS_STEP == 0), float)


def tones(profile: DisplayProfile, channel: int) -> tuple[tuple[int, float], ...]:
    """(axis of the lenses, carrier) of the fringes in one of FRINGE_CHANNELS of the phase pattern.

    Carrier: lenses that a fringe spans for an eye, if the profile is right. Cylinders have one tone in each channel,
    small lenses both, along different axes.
    """
    sheet = profile.sheet
    lenses = (sheet.lenses_across(profile.panel_mm[0]) if isinstance(sheet, Lenticular)
              else min(profile.panel_mm) / max(sheet.pitches))
    carrier = float(np.clip(lenses / FRINGES, MIN_CARRIER, MAX_CARRIER))
    first, second = (carrier, carrier * FINER)[::1 if channel == FRINGE_CHANNELS[0] else -1]
    return ((0, first),) if profile.lenticular else ((0, first), (1, second))


@dataclasses.dataclass(frozen=True)
class Dots:
    """The landmarks of the phase pattern, in millimetres from the panel's centre, y up."""

    x: Array  # (columns,) of their centres
    y: Array  # (rows,)
    signs: Array  # (rows, columns) 1 light, -1 dark
    spread: float  # standard deviation

    def shown(self, x: Array, y: Array, spread: float | None = None) -> Array:
        """Value of DOT_CHANNEL at (x, y), which may be a row and a column, with dots of another ``spread`` if given."""
        across, up = (np.exp(-0.5 * ((place[..., None] - axis) / (spread or self.spread)) ** 2)
                      for place, axis in ((x, self.x), (y, self.y)))
        return np.asarray(DOT_LIGHT + DOT_CONTRAST * np.clip((up @ self.signs * across).sum(-1), -1, 1))


def dots(profile: DisplayProfile) -> Dots:
    """Landmarks of the phase pattern of a display with a lens sheet."""
    step = max(max(profile.panel_mm) / MOST_DOTS, DOT_LENSES * max(profile.sheet.pitches))
    counts = [min(max(round(size / step), 2), MOST_DOTS) for size in profile.panel_mm]
    x, y = (((np.arange(count) + 0.5) / count - 0.5) * size
            for count, size in zip(counts, profile.panel_mm, strict=True))
    bits = np.array([CODE >> bit & 1 for bit in reversed(range(MOST_DOTS ** 2))]).reshape(MOST_DOTS, MOST_DOTS)
    return Dots(x, y, bits[:len(y), :len(x)] * 2.0 - 1, step * DOT_SPREAD)
