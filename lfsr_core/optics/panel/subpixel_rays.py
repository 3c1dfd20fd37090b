"""Which ray of the regular light field each subpixel of a panel with a lens sheet sends.

A subpixel's light leaves through the centre of its lens, or the axis of its cylinder, and meets the camera plane at
the viewing distance: lens and view follow, both as fractions. RESEARCH: LFDisplay's two lattices, Looking Glass'
calibrations. The light field's display plane is the plane of the lenses; it shows what lies before the panel for an
eye in the middle of the viewing zone.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.sheet import Lattice, Lenslet, Lenticular, Subpixels


@dataclasses.dataclass(frozen=True)
class SubpixelRays:
    """Places in the regular light field, whole numbers at the centres of lenses and views; arrays broadcast."""

    # column, row: of the lens, rows from the top
    column: Array
    row: Array
    # view_x, view_y: of the view, from the left and from the top
    view_x: Array
    view_y: Array


@dataclasses.dataclass(frozen=True)
class Geometry:
    """What follows from a profile with a lens sheet; lengths in millimetres."""

    pixel: tuple[float, float]  # pitch of the panel
    distance: float  # from the lenses to the viewer
    gap: float  # from the panel to the lenses
    lens_plane: tuple[float, float]  # size of the light field's display plane
    spacing: float  # between neighbouring views at the viewing distance

    @classmethod
    def of(cls, profile: DisplayProfile) -> Geometry:
        """Of a woven profile. Without a stated gap it is what gives an elemental image the viewing angle."""
        distance, half = profile.viewing_distance_mm, math.tan(math.radians(profile.viewing_angle_deg) / 2)
        gap = sheet_gap(profile.lenslet or profile.lenticular, half, distance)
        nearer = distance / (distance + gap)
        width, height = profile.panel_mm
        return cls((width / profile.panel_pixels[0], height / profile.panel_pixels[1]), distance, gap,
                   (width * nearer, height * nearer), profile.camera_spacing_mm)


def sheet_gap(sheet: Lenslet | Lenticular, half_tangent: float, distance: float) -> float:
    """Millimetres from panel to lenses: as stated, or so that an elemental image fills the viewing angle.

    ``half_tangent``: tan(angle / 2). Elemental image = lens pitch · (1 + gap / distance) = 2 · gap · tan(angle / 2).
    """
    if isinstance(sheet, Lenticular):
        # A lenticular's pitch is that of its elemental images, as calibrations state it; along a row of pixels.
        return sheet.pitch_mm / math.cos(math.atan(sheet.slant)) / 2 / half_tangent
    if sheet.gap_mm is not None:
        return sheet.gap_mm
    if sheet.elemental_images is not None:
        return sheet.elemental_images.pitch_mm[0] / 2 / half_tangent
    pitch = sheet.lenses.pitch_mm[0]
    return pitch / (2 * half_tangent - pitch / distance)


def subpixel_rays(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> SubpixelRays:
    """Rays of one channel (0 red … 2 blue) of pixels of the panel's image.

    ``rows`` from the top and ``columns`` broadcast. Fractions are not clipped to the light field. ``profile`` must be
    woven.
    """
    return point_rays(profile, *subpixel_places(profile, channel, rows, columns))


def point_rays(profile: DisplayProfile, x: Array, y: Array) -> SubpixelRays:
    """Rays of points of the panel, millimetres from its centre, y up. ``profile`` must be woven."""
    of_sheet = _through_cylinders if profile.lenticular else _through_lenses
    return of_sheet(profile, Geometry.of(profile), x, y)


def subpixel_places(profile: DisplayProfile, channel: int, rows: Array,
                    columns: Array) -> tuple[Array, Array]:
    """Millimetres (x, y) from the panel's centre, y up, of the subpixels of a channel; ``rows`` from the top."""
    across, down = profile.panel_pixels
    x, y = np.asarray(columns), down - 1 - np.asarray(rows)
    flip = profile.lenticular.flip if profile.lenticular else (False, False)
    x, y = across - 1 - x if flip[0] else x, down - 1 - y if flip[1] else y
    right, up = (profile.subpixels or Subpixels()).offsets(channel, y, x)
    return (((x + 0.5 + right) / across - 0.5) * profile.panel_mm[0],
            ((y + 0.5 + up) / down - 0.5) * profile.panel_mm[1])


def _through_cylinders(profile: DisplayProfile, geometry: Geometry, x: Array, y: Array) -> SubpixelRays:
    sheet, (width, height) = profile.lenticular, profile.panel_mm
    across = sheet.lenses_across(width)
    # RESEARCH: a = (x + y·tilt)·P − center with x, y in 0 … 1 and tilt = slant·height / width.
    phase = (x / width + 0.5 + (y / height + 0.5) * sheet.slant * height / width) * across - sheet.center
    inside = phase - np.floor(phase)
    view = (inside if sheet.reversed else 1 - inside) * profile.views[0] - 0.5
    # The axis, where it passes the ray to the camera line: from the panel a share ``nearer`` of the way is left.
    nearer = geometry.distance / (geometry.distance + geometry.gap)
    on_axis = x - (inside - 0.5) * width / across
    eye = -(inside - 0.5) * profile.views[0] * geometry.spacing
    return _in_light_field(profile, geometry, (_axis_point(sheet, (on_axis, x, y), nearer, eye)), (view, np.float64(0)))


def _axis_point(sheet: Lenticular, place: tuple[Array, ...], nearer: float,
                eye: Array) -> tuple[Array, Array]:
    """Where light of a subpixel passes its cylinder's axis on its way to (``eye``, 0).

    ``place``: x of the elemental image's middle in the subpixel's row, x and y of the subpixel. Square to the axis
    the point is the middle's, seen from the viewing distance; along it light goes straight on.
    """
    middle, x, y = place
    long = math.hypot(1, sheet.slant)
    normal, along = (1 / long, sheet.slant / long), (-sheet.slant / long, 1 / long)
    across = (middle * normal[0] + y * normal[1]) * nearer
    straight = (x * along[0] + y * along[1]) * nearer + eye * along[0] * (1 - nearer)
    return across * normal[0] + straight * along[0], across * normal[1] + straight * along[1]


def _through_lenses(profile: DisplayProfile, geometry: Geometry, x: Array, y: Array) -> SubpixelRays:
    sheet = profile.lenslet
    first, second = nearest_point(elemental_lattice(profile), sheet.packing, x, y)
    center_x, center_y = lattice_point(sheet.lenses, sheet.packing, first, second)
    throw = geometry.distance / geometry.gap / geometry.spacing
    view = ((center_x - x) * throw + center_x / geometry.spacing + (profile.views[0] - 1) / 2,
            (y - center_y) * throw - center_y / geometry.spacing + (profile.views[1] - 1) / 2)
    return _in_light_field(profile, geometry, (center_x, center_y), view)


def _in_light_field(profile: DisplayProfile, geometry: Geometry, point: tuple[Array, Array],
                    view: tuple[Array, Array]) -> SubpixelRays:
    """``point``: millimetres on the plane of the lenses, from its centre, y up."""
    (width, height), (columns, rows) = geometry.lens_plane, profile.lenses
    return SubpixelRays((point[0] / width + 0.5) * columns - 0.5, (0.5 - point[1] / height) * rows - 0.5, *view)


def lattice_point(lattice: Lattice, packing: str, first: Array, second: Array) -> tuple[Array,
                                                                                                  Array]:
    """(x, y) of the lattice's points (first, second)."""
    matrix = lattice.matrix(packing)
    return (matrix[0, 0] * first + matrix[0, 1] * second + lattice.shift_mm[0],
            matrix[1, 0] * first + matrix[1, 1] * second + lattice.shift_mm[1])


def nearest_point(lattice: Lattice, packing: str, x: Array, y: Array) -> tuple[Array, Array]:
    """Numbers (first, second) of the point of the lattice nearest to (x, y)."""
    inverse = np.linalg.inv(lattice.matrix(packing))
    right, up = x - lattice.shift_mm[0], y - lattice.shift_mm[1]
    first, second = (inverse[n, 0] * right + inverse[n, 1] * up for n in (0, 1))
    if packing == "square" and not lattice.shear:
        return np.floor(first + 0.5), np.floor(second + 0.5)
    return _nearest_of_four(lattice.matrix(packing), first, second)


def _nearest_of_four(matrix: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Of the corners of the cell that (first, second) lies in; enough unless the lattice is much sheared."""
    left, below = np.floor(first), np.floor(second)
    in_first, in_second = first - left, second - below
    metric = matrix.T @ matrix
    best, step_first, step_second = None, np.zeros_like(left), np.zeros_like(left)
    for one, two in ((0, 0), (1, 0), (0, 1), (1, 1)):
        a, b = in_first - one, in_second - two
        far = metric[0, 0] * a * a + 2 * metric[0, 1] * a * b + metric[1, 1] * b * b
        nearer = np.ones(far.shape, bool) if best is None else far < best
        best = np.where(nearer, far, best) if best is not None else far
        step_first, step_second = np.where(nearer, one, step_first), np.where(nearer, two, step_second)
    return left + step_first, below + step_second


def lattice_coordinates(profile: DisplayProfile, x: Array, y: Array) -> tuple[Array, Array]:
    """Places on the panel, millimetres from its centre, counted in elemental images: whole in the middle of each.

    Along both steps of the lattice; of cylinders from one to the next, and 0.
    """
    waves, phases = elemental_waves(profile)
    first, second = (wave[0] * x + wave[1] * y - phase for wave, phase in zip(waves, phases, strict=True))
    return first, second


def elemental_waves(profile: DisplayProfile) -> tuple[Array, Array]:
    """(2, 2) elemental images per millimetre (x, y) along each step of their lattice, and (2,) phases at the centre."""
    if profile.lenticular:
        sheet, (width, height) = profile.lenticular, profile.panel_mm
        across = sheet.lenses_across(width)
        wave = np.array([1.0, sheet.slant]) * across / width
        phase = sheet.center + 0.5 - across / 2 * (1 + sheet.slant * height / width)
        return np.stack([wave, np.zeros(2)]), np.array([phase, 0.0])
    images = elemental_lattice(profile)
    waves = np.linalg.inv(images.matrix(profile.lenslet.packing))
    return waves, waves @ np.array(images.shift_mm)


def elemental_lattice(profile: DisplayProfile) -> Lattice:
    """Middles of the elemental images of a lenslet profile: stated, or the lenses seen from the viewing distance."""
    geometry, sheet = Geometry.of(profile), profile.lenslet
    return sheet.elemental_images or sheet.lenses.scaled(1 + geometry.gap / geometry.distance)
