"""The ray of the regular light field that each subpixel of a panel with a lens sheet sends.

Light of a subpixel leaves through the centre of its lens, or the axis of its cylinder, and meets the camera plane at
the viewing distance. This gives lens and view, both as fractions. The light field's display plane is the plane of the
lenses: the part of it that covers the panel for an eye in the middle of the viewing zone.
"""

import dataclasses
import math
from typing import NamedTuple, Self

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile, Lattice, Lenslet, Lenticular
from lfsr_core.optics.rays import CameraArray

Pair = tuple[Array, Array]
PERIOD = 4  # pixels after which every cell rule repeats
CHANNELS = 3


class SubpixelRays(NamedTuple):
    """Places in the regular light field, whole numbers at the centres of lenses and views; arrays broadcast."""

    column: Array  # of the lens
    row: Array  # of the lens, from the top
    view_x: Array  # from the left
    view_y: Array  # from the top


@dataclasses.dataclass(frozen=True)
class Geometry:
    """Lengths that follow from a profile with a lens sheet, in millimetres."""

    pixel: tuple[float, float]  # pitch of the panel
    distance: float  # from the lenses to the viewer
    gap: float  # from the panel to the lenses
    lens_plane: tuple[float, float]  # size of the light field's display plane
    spacing: float  # between neighbouring views at the viewing distance

    @classmethod
    def of(cls, profile: DisplayProfile) -> Self:
        """Geometry of a display with a lens sheet."""
        distance, half = profile.viewing_distance_mm, math.tan(math.radians(profile.viewing_angle_deg) / 2)
        # Unless the gap is stated, an elemental image fills the viewing angle:
        # elemental image = lens pitch · (1 + gap / distance) = 2 · gap · tan(angle / 2).
        if isinstance(sheet := profile.sheet, Lenticular):
            # Calibrations state the pitch of a lenticular's elemental images; here along a row of pixels.
            gap = sheet.pitch_mm / math.cos(math.atan(sheet.slant)) / 2 / half
        elif sheet.gap_mm is not None:
            gap = sheet.gap_mm
        elif sheet.elemental_images is not None:
            gap = sheet.elemental_images.pitch_mm[0] / 2 / half
        else:
            gap = sheet.lenses.pitch_mm[0] / (2 * half - sheet.lenses.pitch_mm[0] / distance)
        width, height = profile.panel_mm
        nearer = distance / (distance + gap)
        return cls((width / profile.panel_pixels[0], height / profile.panel_pixels[1]), distance, gap,
                   (width * nearer, height * nearer), profile.camera_spacing_mm)

    @property
    def nearer(self) -> float:
        """Ratio of the viewer's distances from the lenses and from the panel, below 1."""
        return self.distance / (self.distance + self.gap)


def subpixel_rays(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> SubpixelRays:
    """Rays of the subpixels of one channel (0 red … 2 blue) in the panel's image.

    ``rows`` from the top and ``columns`` broadcast. The fractions are not clipped to the light field. The display must
    have a lens sheet.
    """
    return point_rays(profile, *subpixel_places(profile, channel, rows, columns))


def point_rays(profile: DisplayProfile, x: Array, y: Array) -> SubpixelRays:
    """Rays of points of a panel with a lens sheet, millimetres from its centre, y up."""
    sheet, geometry = profile.sheet, Geometry.of(profile)
    # ``point``: where rays cross the plane of the lenses, millimetres from its centre, y up.
    if isinstance(sheet, Lenticular):
        (width, height), (normal, along), nearer = profile.panel_mm, sheet.directions, geometry.nearer
        cylinders = sheet.lenses_across(width)
        # Calibrations: a = (x + y·tilt)·P − center with x, y from 0 to 1 and tilt = slant·height / width.
        phase = (x / width + 0.5 + (y / height + 0.5) * sheet.slant * height / width) * cylinders - sheet.center
        inside = phase - np.floor(phase)
        view = (inside if sheet.reversed else 1 - inside) * profile.views[0] - 0.5, np.array(0.0)
        middle = x - (inside - 0.5) * width / cylinders  # of the elemental image, in the subpixel's row
        eye = -(inside - 0.5) * profile.views[0] * geometry.spacing
        # Light goes to (eye, 0). Perpendicular to the axis it crosses the plane where that middle is seen from the
        # viewing distance; along the axis it goes straight on.
        across = (middle * normal[0] + y * normal[1]) * nearer
        straight = (x * along[0] + y * along[1]) * nearer + eye * along[0] * (1 - nearer)
        point = across * normal[0] + straight * along[0], across * normal[1] + straight * along[1]
    else:
        numbers = nearest_point(elemental_lattice(sheet, geometry), sheet.packing, x, y)
        point = lattice_point(sheet.lenses, sheet.packing, *numbers)
        throw = geometry.distance / geometry.gap / geometry.spacing
        view = ((point[0] - x) * throw + point[0] / geometry.spacing + (profile.views[0] - 1) / 2,
                (y - point[1]) * throw - point[1] / geometry.spacing + (profile.views[1] - 1) / 2)
    (width, height), (columns, rows) = geometry.lens_plane, profile.lenses
    return SubpixelRays((point[0] / width + 0.5) * columns - 0.5, (0.5 - point[1] / height) * rows - 0.5, *view)


def subpixel_places(profile: DisplayProfile, channel: int, rows: Array, columns: Array) -> tuple[Array, Array]:
    """Millimetres (x, y) from the panel's centre, y up, of the subpixels of a channel; ``rows`` from the top."""
    across, down = profile.panel_pixels
    x, y = np.asarray(columns), down - 1 - np.asarray(rows)
    x, y = across - 1 - x if profile.flip[0] else x, down - 1 - y if profile.flip[1] else y
    right, up = profile.pixel_layout.offsets(channel, y, x)
    return (((x + 0.5 + right) / across - 0.5) * profile.panel_mm[0],
            ((y + 0.5 + up) / down - 0.5) * profile.panel_mm[1])


def lattice_point(lattice: Lattice, packing: str, first: Array, second: Array) -> Pair:
    """(x, y) of the points of a lattice with the numbers (first, second)."""
    matrix = lattice.matrix(packing)
    return (matrix[0, 0] * first + matrix[0, 1] * second + lattice.shift_mm[0],
            matrix[1, 0] * first + matrix[1, 1] * second + lattice.shift_mm[1])


def nearest_point(lattice: Lattice, packing: str, x: Array, y: Array) -> Pair:
    """Numbers (first, second) of the lattice point nearest to (x, y)."""
    plain, steps = packing == "square" and not lattice.shear, lattice.matrix(packing)
    short = np.eye(2) if plain else short_steps(steps)
    matrix = steps @ short
    inverse = np.linalg.inv(matrix)
    right, up = x - lattice.shift_mm[0], y - lattice.shift_mm[1]
    first, second = (inverse[n, 0] * right + inverse[n, 1] * up for n in (0, 1))
    if plain:
        return np.floor(first + 0.5), np.floor(second + 0.5)
    # Nearest corner of the cell around the place.
    left, below = np.floor(first), np.floor(second)
    in_first, in_second = first - left, second - below
    metric = matrix.T @ matrix
    best, step_first, step_second = np.full(left.shape, np.inf), np.zeros_like(left), np.zeros_like(left)
    for one, two in ((0, 0), (1, 0), (0, 1), (1, 1)):
        a, b = in_first - one, in_second - two
        far = metric[0, 0] * a * a + 2 * metric[0, 1] * a * b + metric[1, 1] * b * b
        nearer = far < best
        best = np.where(nearer, far, best)
        step_first, step_second = np.where(nearer, one, step_first), np.where(nearer, two, step_second)
    first, second = left + step_first, below + step_second
    return short[0, 0] * first + short[0, 1] * second, short[1, 0] * first + short[1, 1] * second


def short_steps(steps: Array) -> Array:
    """Return (2, 2) whole numbers: columns that combine the ``steps`` of a lattice (columns) to its two shortest steps.

    They make the same lattice (Lagrange's reduction). The angle between the two is 60 to 120 degrees.
    """
    short = np.eye(2)
    while True:
        along, up = (steps @ short).T
        short[:, 1] -= np.rint(along @ up / (along @ along)) * short[:, 0]
        up = steps @ short[:, 1]
        if up @ up > (1 - 1e-9) * (along @ along):
            return short
        short = short[:, ::-1].copy()


def lattice_coordinates(profile: DisplayProfile, x: Array, y: Array) -> Pair:
    """Places on the panel counted in elemental images, whole numbers at their centres.

    ``x``, ``y``: millimetres from the panel's centre. One coordinate along each step of the lattice; for cylinders
    from one to the next, and 0.
    """
    waves, phases = elemental_waves(profile)
    first, second = (wave[0] * x + wave[1] * y - phase for wave, phase in zip(waves, phases, strict=True))
    return first, second


def elemental_waves(profile: DisplayProfile) -> Pair:
    """(2, 2) elemental images per millimetre (x, y) along each step of their lattice, and (2,) phases at the centre."""
    if isinstance(sheet := profile.sheet, Lenticular):
        width, height = profile.panel_mm
        across = sheet.lenses_across(width)
        wave = np.array([1.0, sheet.slant]) * across / width
        phase = sheet.center + 0.5 - across / 2 * (1 + sheet.slant * height / width)
        return np.stack([wave, np.zeros(2)]), np.array([phase, 0.0])
    images = elemental_lattice(sheet, Geometry.of(profile))
    waves = np.linalg.inv(images.matrix(sheet.packing))
    return waves, waves @ np.array(images.shift_mm)


def elemental_lattice(sheet: Lenslet, geometry: Geometry) -> Lattice:
    """Centres of the elemental images: as stated, or the lenses as seen from the viewing distance."""
    return sheet.elemental_images or sheet.lenses.scaled(1 + geometry.gap / geometry.distance)


@dataclasses.dataclass(frozen=True)
class PanelLayout:
    """Which ray each pixel sends in a render of a panel's subpixels."""

    display: DisplayProfile  # with a lens sheet
    array: CameraArray  # placement of the dense camera array
    aperture: float = 1.0  # fraction of a lens, along each axis, that rays cover, in [0, 1] (0: its centre)

    def __post_init__(self) -> None:
        check_sheet(self.display)

    @property
    def size(self) -> tuple[int, int]:
        """Rendered image size in pixels, (width, height)."""
        return rendered_size(self.display)

    @property
    def reach(self) -> float:
        """Distance from the array's axis, in scene units, beyond which no ray starts (an upper bound)."""
        return 2 * max(self.display.views) * self.array.spacing


def check_sheet(display: DisplayProfile) -> None:
    """LfsrError unless the display has a lens sheet, so that its subpixels send rays of their own."""
    if not display.is_woven:
        raise LfsrError(f"display {display.name!r} has no lens sheet, so that its elemental images are the panel's "
                        "image already: render its elemental images, or give a profile of format 2")


def rendered_size(display: DisplayProfile) -> tuple[int, int]:
    """Size in pixels, (width, height), of a render of the subpixels of a display with a lens sheet."""
    return display.panel_pixels[0] * display.pixel_layout.count, display.panel_pixels[1]


def subpixel_table(layout: PanelLayout) -> tuple[Array, Array, Array]:
    """The subpixels of every pixel, from left to right in the panel's image: (PERIOD, PERIOD, n) each.

    By pixel row (from the panel's bottom) and column, both modulo PERIOD: offsets (right, up) from the pixel's centre
    in pixels, and the channel, 0 red … 2 blue; 0 if a subpixel shows all three.
    """
    if layout.display.pixel_layout.count == 1:
        zeros = np.zeros((PERIOD, PERIOD, 1))
        return zeros, zeros, zeros.astype(int)
    rows, columns = np.arange(PERIOD)[:, None], np.arange(PERIOD)
    offsets = [layout.display.pixel_layout.offsets(channel, rows, columns) for channel in range(CHANNELS)]
    right, up = (np.stack([np.broadcast_to(pair[axis], (PERIOD, PERIOD)) for pair in offsets], -1) for axis in (0, 1))
    order = np.argsort(-right if layout.display.flip[0] else right, axis=-1, kind="stable")
    return np.take_along_axis(right, order, -1), np.take_along_axis(up, order, -1), order


def panel_image(layout: PanelLayout, rendered: Array) -> Array:
    """Panel image (H, W, 3): each subpixel takes its own channel of its ray's colour.

    ``rendered``: of the rendered size, rows from the top.
    """
    if layout.display.pixel_layout.count == 1:
        return rendered
    width, height = layout.display.panel_pixels
    by_pixel = rendered.reshape(height, width, CHANNELS, CHANNELS)
    flip = layout.display.flip  # whether the image is mirrored on the panel
    rows, columns = np.arange(height)[::1 if flip[1] else -1], np.arange(width)[::-1 if flip[0] else 1]
    channel = subpixel_table(layout)[2][rows[:, None] % PERIOD, columns % PERIOD]
    place = np.argsort(channel, axis=-1)  # of the subpixel that shows each colour
    return np.take_along_axis(by_pixel, place[:, :, None], 2)[:, :, 0]
