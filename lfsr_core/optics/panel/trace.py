"""What an eye sees of a panel with a lens sheet: rays from the eye through the lenses to the subpixels.

Written from the optics alone, the other way round than ``subpixel_rays.py``, which it is there to check: an eye looks
at a point of the plane of the lenses; the lens there focuses on one point of the panel; a subpixel lies there.
A lens is a pinhole; a cylinder is one across its axis, and along it light goes straight on.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import Geometry, subpixel_places
from lfsr_core.optics.sheet import Subpixels

SAMPLES = 24  # rays per pixel of the result
# Bases of the generalised golden ratio in four dimensions: points that fill the unit cube evenly.
GOLDEN = np.array([0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101])


@dataclasses.dataclass(frozen=True)
class Seen:
    """Subpixels that rays of an eye end on; arrays of one shape."""

    row: Array  # of the panel's image, from the top
    column: Array  # of the panel's image
    channel: Array  # 0 red, 1 green, 2 blue; -1 where a pixel shows all three
    on_panel: Array  # bool; elsewhere the numbers above are of the nearest pixel


def seen_panel(panel: Array, profile: DisplayProfile, eye_mm: tuple[float, float, float]) -> Array:
    """Return what an eye sees of a woven panel's image, about one pixel per lens of the sheet across.

    Parameters
    ----------
    panel : (H, W, 3) uint8, as in panel.png
    profile : the display, with a lens sheet
    eye_mm : (x, y, z) of the eye from the middle of the lenses, y up, z towards the viewer

    Returns
    -------
    (rows, columns, 3) uint8, black beyond the panel
    """
    columns, rows = _result_size(profile)
    light, count = np.zeros((rows, columns, 3)), np.zeros((rows, columns, 3))
    for sample in range(SAMPLES):
        place = np.modf(0.5 + sample * GOLDEN)[0]
        seen = _seen_by_pixels(profile, eye_mm, (columns, rows), place)
        values = panel[seen.row, seen.column] * seen.on_panel[..., None]
        shown = (seen.channel[..., None] == np.arange(3)) | (seen.channel[..., None] < 0)
        light += values * shown
        count += shown
    return np.rint(_filled(light) / np.maximum(_filled(count), 1e-12)).astype(np.uint8)


def trace(profile: DisplayProfile, eye_mm: tuple[float, float, float], x: Array, y: Array,
          spread: tuple[float, float] = (0.0, 0.0)) -> Seen:
    """Subpixels that an eye sees at points (x, y) of the plane of the lenses, millimetres from its middle, y up.

    ``spread``: by how many pixels the focus lies off.
    """
    focus = _cylinder_focus if profile.lenticular else _lens_focus
    on_x, on_y = focus(profile, Geometry.of(profile), eye_mm, (x, y))
    pixel = Geometry.of(profile).pixel
    return _subpixel_at(profile, on_x + spread[0] * pixel[0], on_y + spread[1] * pixel[1])


def _result_size(profile: DisplayProfile) -> tuple[int, int]:
    """Columns and rows of about one lens each, with the panel's proportions."""
    width, height = profile.panel_mm
    columns = max(1, round(Geometry.of(profile).lens_plane[0] / profile.lenslet.lenses.pitch_mm[0] if profile.lenslet
                           else width / profile.lenticular.pitch_mm))
    return columns, max(1, round(columns * height / width))


def _seen_by_pixels(profile: DisplayProfile, eye_mm: tuple[float, float, float], size: tuple[int, int],
                    place: Array) -> Seen:
    """One ray of every pixel of a picture of ``size``, through ``place`` in [0, 1)⁴: in the pixel, in the focus."""
    (columns, rows), (width, height) = size, Geometry.of(profile).lens_plane
    x = ((np.arange(columns) + place[0]) / columns - 0.5) * width
    y = (0.5 - (np.arange(rows)[:, None] + place[1]) / rows) * height
    wide = _focus_width(profile)
    return trace(profile, eye_mm, *np.broadcast_arrays(x, y), ((place[2] - 0.5) * wide, (place[3] - 0.5) * wide))


def _focus_width(profile: DisplayProfile) -> float:
    """In pixels: a lens focuses on a whole pixel, else it would show one colour; a cylinder passes many rows anyway."""
    if (profile.subpixels or Subpixels()).size == (1.0, 1.0):
        return 0.0
    return 1.0 if profile.lenslet else 1 / 3


def _cylinder_focus(profile: DisplayProfile, geometry: Geometry, eye: tuple[float, float, float],
                    point: tuple[Array, Array]) -> tuple[Array, Array]:
    sheet, (width, height) = profile.lenticular, profile.panel_mm
    long = math.hypot(1, sheet.slant)
    normal, along = np.array([1, sheet.slant]) / long, np.array([-sheet.slant, 1]) / long
    # The panel's lower left corner lies ``center`` pitches beyond a border of two elemental images; their middles are
    # half a pitch further, and seen from the viewing distance the axes stand before them.
    start = (-width / 2 * normal[0] - height / 2 * normal[1]) + (sheet.center + 0.5) * sheet.pitch_mm
    nearer = geometry.distance / (geometry.distance + geometry.gap)
    pitch = sheet.pitch_mm * nearer
    off = point[0] * normal[0] + point[1] * normal[1]
    axis = start * nearer + np.round((off - start * nearer) / pitch) * pitch
    length = point[0] * along[0] + point[1] * along[1]
    behind = geometry.gap / eye[2]
    across = axis + (axis - eye[0] * normal[0] - eye[1] * normal[1]) * behind
    length = length + (length - eye[0] * along[0] - eye[1] * along[1]) * behind
    return across * normal[0] + length * along[0], across * normal[1] + length * along[1]


def _lens_focus(profile: DisplayProfile, geometry: Geometry, eye: tuple[float, float, float],
                point: tuple[Array, Array]) -> tuple[Array, Array]:
    lattice = profile.lenslet.lenses
    matrix = lattice.matrix(profile.lenslet.packing)
    right, up = point[0] - lattice.shift_mm[0], point[1] - lattice.shift_mm[1]
    around = [np.round(number) for number in np.einsum("ij,j...->i...", np.linalg.inv(matrix), np.stack([right, up]))]
    best = np.full(np.shape(right), np.inf)
    center_x, center_y = np.zeros_like(best), np.zeros_like(best)
    for one, two in itertools.product((-1, 0, 1), repeat=2):
        x = matrix[0, 0] * (around[0] + one) + matrix[0, 1] * (around[1] + two)
        y = matrix[1, 0] * (around[0] + one) + matrix[1, 1] * (around[1] + two)
        far = (x - right) ** 2 + (y - up) ** 2
        center_x, center_y = np.where(far < best, x, center_x), np.where(far < best, y, center_y)
        best = np.minimum(best, far)
    center_x, center_y = center_x + lattice.shift_mm[0], center_y + lattice.shift_mm[1]
    behind = geometry.gap / eye[2]
    return center_x + (center_x - eye[0]) * behind, center_y + (center_y - eye[1]) * behind


def _subpixel_at(profile: DisplayProfile, x: Array, y: Array) -> Seen:
    """The subpixel at a point of the panel, millimetres from its centre: the nearest of those of the pixels around."""
    (across, down), (width, height) = profile.panel_pixels, profile.panel_mm
    column = np.floor((x / width + 0.5) * across).astype(int)
    row = np.floor((0.5 - y / height) * down).astype(int)
    on_panel = (column >= 0) & (column < across) & (row >= 0) & (row < down)
    if profile.lenticular and profile.lenticular.flip[0]:
        column = across - 1 - column
    if profile.lenticular and profile.lenticular.flip[1]:
        row = down - 1 - row
    row, column = np.clip(row, 0, down - 1), np.clip(column, 0, across - 1)
    subpixels = profile.subpixels or Subpixels()
    if subpixels.size == (1.0, 1.0):
        return Seen(row, column, np.full(row.shape, -1), on_panel)
    if subpixels.cells:
        return _nearest_subpixel(profile, x, y, Seen(row, column, row, on_panel))
    third = np.floor(((x / width + 0.5) * across % 1) * 3).astype(int).clip(0, 2)
    return Seen(row, column, third if subpixels.stripes == "rgb" else 2 - third, on_panel)


def _nearest_subpixel(profile: DisplayProfile, x: Array, y: Array, near: Seen) -> Seen:
    across, down = profile.panel_pixels
    best = np.full(x.shape, np.inf)
    found = [np.zeros(x.shape, int) for _ in range(3)]
    for one, two, channel in itertools.product((-1, 0, 1), (-1, 0, 1), range(3)):
        row, column = np.clip(near.row + one, 0, down - 1), np.clip(near.column + two, 0, across - 1)
        at_x, at_y = subpixel_places(profile, channel, row, column)
        far = (at_x - x) ** 2 + (at_y - y) ** 2
        found = [np.where(far < best, new, old) for new, old in zip((row, column, channel), found, strict=True)]
        best = np.minimum(best, far)
    return Seen(*found, near.on_panel)


def _filled(values: Array) -> Array:
    """A little of the eight neighbours, so that a channel that no ray of a pixel met is theirs."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    rows, columns = values.shape[:2]
    around = sum(padded[y:y + rows, x:x + columns] for y in range(3) for x in range(3)) - values
    return values + 1e-6 * around
