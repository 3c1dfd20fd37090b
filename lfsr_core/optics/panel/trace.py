"""What an eye sees of a panel with a lens sheet: rays from the eye through the lenses to the subpixels.

This traces light in the opposite direction to ``subpixel_rays.py`` and shares no optics with it, so that each checks
the other: an eye looks at a point on the plane of the lenses; the lens there focuses on a point of the panel; a
subpixel lies there. A lens is a pinhole. A cylinder is a pinhole across its axis; along it light goes straight on.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.optics.display import DisplayProfile, Lenticular
from lfsr_core.optics.panel.subpixel_rays import Geometry, subpixel_places, subpixel_rays

SAMPLES = 24  # rays per pixel of the result
# Bases of the generalised golden ratio in four dimensions: points that fill the unit cube evenly.
GOLDEN = np.array([0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101])
Point = tuple[float, float, float]
PLACES = (0.25, 0.5, 0.75)  # of the viewing zone
POINTS = 20_000
BORDER = 0.9  # fraction of the panel that is measured: near its edge an eye at the side looks past the panel


@dataclasses.dataclass(frozen=True)
class SeenSubpixels:
    """Subpixels that rays from an eye reach; arrays of one shape."""

    row: Array  # of the panel's image, from the top
    column: Array  # of the panel's image
    channel: Array  # 0 red, 1 green, 2 blue; -1 where a pixel shows all three
    on_panel: Mask  # elsewhere the other arrays hold the nearest pixel


def seen_panel(panel: Array, profile: DisplayProfile, eye_mm: Point) -> Array:
    """Return what an eye sees of a woven panel's image (H, W, 3) uint8, as in panel.png.

    The result (rows, columns, 3) uint8 has about one pixel per lens across and is black beyond the panel. ``eye_mm``:
    (x, y, z) from the middle of the lenses, y up, z towards the viewer.
    """
    sheet, (width, height) = profile.sheet, Geometry.of(profile).lens_plane
    columns = max(1, round(profile.panel_mm[0] / sheet.pitch_mm if isinstance(sheet, Lenticular)
                           else width / sheet.lenses.pitch_mm[0]))
    rows = max(1, round(columns * profile.panel_mm[1] / profile.panel_mm[0]))
    x, y = ((np.arange(columns) + 0.5) / columns - 0.5) * width, (0.5 - (np.arange(rows) + 0.5) / rows) * height
    image: Array = np.rint(seen_at(panel, profile, eye_mm, x, y)).astype(np.uint8)
    return image


def seen_at(panel: Array, profile: DisplayProfile, eye_mm: Point, x: Array, y: Array) -> Array:
    """Return what an eye sees of a panel's image at evenly spaced places: float (rows, columns, 3), 0 to 255.

    ``x`` (columns,), ``y`` (rows,): millimetres from the middle of the lenses, y up. Each value is a mean around its
    place, black beyond the panel.
    """
    light, count = np.zeros((len(y), len(x), 3)), np.zeros((len(y), len(x), 3))
    # A lens focuses on a whole pixel, or it would show one colour; a cylinder passes many rows anyway.
    wide = 0.0 if profile.pixel_layout.count == 1 else 1.0 if profile.lenslet else 1 / 3
    for sample in range(SAMPLES):
        place = np.modf(0.5 + sample * GOLDEN)[0] - 0.5  # in [-1/2, 1/2)⁴: in the pixel, in the focus
        across, down = (axis + place[number] * (axis[-1] - axis[0]) / max(len(axis) - 1, 1)
                        for number, axis in enumerate((x, y)))
        points_x, points_y = np.meshgrid(across, down)
        seen = trace(profile, eye_mm, points_x, points_y, (place[2] * wide, place[3] * wide))
        values = panel[seen.row, seen.column] * seen.on_panel[..., None]
        shown = (seen.channel[..., None] == np.arange(3)) | (seen.channel[..., None] < 0)
        light += values * shown
        count += shown
    return np.asarray(_filled(light) / np.maximum(_filled(count), 1e-12))


def trace(profile: DisplayProfile, eye_mm: Point, x: Array, y: Array,
          spread: tuple[float, float] = (0.0, 0.0)) -> SeenSubpixels:
    """Subpixels that an eye sees at points (x, y) on the plane of the lenses, millimetres from its middle, y up.

    ``spread``: pixels (right, up) by which the focus is moved.
    """
    sheet, geometry = profile.sheet, Geometry.of(profile)
    (across, down), (width, height), behind = profile.panel_pixels, profile.panel_mm, geometry.gap / eye_mm[2]
    if isinstance(sheet, Lenticular):
        (normal, along), nearer = sheet.directions, geometry.nearer
        # The panel's lower left corner lies ``center`` pitches beyond a border of two elemental images; their centres
        # are half a pitch further, and from the viewing distance the axes are seen in front of these.
        start = (-width / 2 * normal[0] - height / 2 * normal[1]) + (sheet.center + 0.5) * sheet.pitch_mm
        pitch = sheet.pitch_mm * nearer
        off = x * normal[0] + y * normal[1]
        axis = start * nearer + np.round((off - start * nearer) / pitch) * pitch
        length = x * along[0] + y * along[1]
        focus = axis + (axis - eye_mm[0] * normal[0] - eye_mm[1] * normal[1]) * behind
        length = length + (length - eye_mm[0] * along[0] - eye_mm[1] * along[1]) * behind
        on_x, on_y = focus * normal[0] + length * along[0], focus * normal[1] + length * along[1]
    else:
        matrix, (shift_x, shift_y) = sheet.lenses.matrix(sheet.packing), sheet.lenses.shift_mm
        right, up = x - shift_x, y - shift_y
        around = np.round(np.einsum("ij,j...->i...", np.linalg.inv(matrix), np.stack([right, up])))
        best = np.full(np.shape(right), np.inf)
        center_x, center_y = np.zeros_like(best), np.zeros_like(best)
        for one, two in itertools.product((-1, 0, 1), repeat=2):
            at_x = matrix[0, 0] * (around[0] + one) + matrix[0, 1] * (around[1] + two)
            at_y = matrix[1, 0] * (around[0] + one) + matrix[1, 1] * (around[1] + two)
            far = (at_x - right) ** 2 + (at_y - up) ** 2
            center_x, center_y = np.where(far < best, at_x, center_x), np.where(far < best, at_y, center_y)
            best = np.minimum(best, far)
        center_x, center_y = center_x + shift_x, center_y + shift_y
        on_x = center_x + (center_x - eye_mm[0]) * behind
        on_y = center_y + (center_y - eye_mm[1]) * behind
    on_x, on_y = on_x + spread[0] * geometry.pixel[0], on_y + spread[1] * geometry.pixel[1]
    column = np.floor((on_x / width + 0.5) * across).astype(int)
    row = np.floor((0.5 - on_y / height) * down).astype(int)
    on_panel = (column >= 0) & (column < across) & (row >= 0) & (row < down)
    column = across - 1 - column if profile.flip[0] else column
    row = down - 1 - row if profile.flip[1] else row
    row, column = np.clip(row, 0, down - 1), np.clip(column, 0, across - 1)
    subpixels = profile.pixel_layout
    if subpixels.count == 1:
        return SeenSubpixels(row, column, np.full(row.shape, -1), on_panel)
    if subpixels.cells:
        # Of the subpixels of the pixels around, the nearest.
        best, found = np.full(on_x.shape, np.inf), [np.zeros(on_x.shape, int) for _ in range(3)]
        for one, two, channel in itertools.product((-1, 0, 1), (-1, 0, 1), range(3)):
            place = np.clip(row + one, 0, down - 1), np.clip(column + two, 0, across - 1), channel
            at_x, at_y = subpixel_places(profile, channel, *place[:2])
            far = (at_x - on_x) ** 2 + (at_y - on_y) ** 2
            found = [np.where(far < best, new, old) for new, old in zip(place, found, strict=True)]
            best = np.minimum(best, far)
        return SeenSubpixels(found[0], found[1], found[2], on_panel)
    third = np.floor(((on_x / width + 0.5) * across % 1) * 3).astype(int).clip(0, 2)
    return SeenSubpixels(row, column, third if subpixels.stripes == "rgb" else 2 - third, on_panel)


def _filled(values: Array) -> Array:
    """Add a little of the eight neighbours, so that a channel that no ray of a pixel reached takes theirs."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    rows, columns = values.shape[:2]
    around = sum(padded[y:y + rows, x:x + columns] for y in range(3) for x in range(3)) - values
    filled: Array = values + 1e-6 * around
    return filled


@dataclasses.dataclass(frozen=True)
class ViewSpread:
    """Fractions of the light that an eye at the centre of a view sees, mean over the panel and places in the zone."""

    own: float  # from that view
    neighbours: float  # from the views beside it
    others: float  # from any other view: crosstalk
    error: float  # mean difference of the views seen from the eye's, in views across: 0 if the weave is correct


def view_spread(profile: DisplayProfile) -> ViewSpread:
    """Measure a display with a lens sheet by ``POINTS`` rays from each of ``PLACES``."""
    random, parts, geometry = np.random.default_rng(0), [], Geometry.of(profile)
    for place in PLACES:
        view = [round(place * (count - 1)) for count in profile.views]
        # An eye at the centre of that view looks at random points.
        across, down = ((number - (count - 1) / 2) * geometry.spacing
                        for number, count in zip(view, profile.views, strict=True))
        x, y = ((random.random(POINTS) - 0.5) * size * BORDER for size in geometry.lens_plane)
        seen = trace(profile, (across, -down, geometry.distance), x, y)
        off = np.zeros((2, POINTS))  # distances, in views across and down, of what it sees there
        for channel in range(3):
            rays = subpixel_rays(profile, channel, seen.row, seen.column)
            chosen = seen.channel == channel if seen.channel.min() >= 0 else np.arange(POINTS) % 3 == channel
            for axis, shown in enumerate((rays.view_x, rays.view_y)):
                inside = np.clip(shown, 0, profile.views[axis] - 1)
                off[axis] = np.where(chosen, inside - view[axis], off[axis])
        off = off[:, seen.on_panel]
        on_place = np.clip(1 - np.abs(off), 0, None).prod(0)
        beside = sum(np.clip(1 - np.abs(off - step), 0, None) for step in (-1, 0, 1)).prod(0)
        parts.append((on_place.mean(), (beside - on_place).mean(), (1 - beside).mean(), off[0].mean()))
    return ViewSpread(*map(float, np.mean(parts, 0)))
