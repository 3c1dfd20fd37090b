"""The panel card: a quad before an orthographic camera that turns its parallel rays into those of a panel's subpixels.

All that decides a ray (``tests/support/reference_rays.py``) is linear in the place on the panel and in how far that
place is from the centre of its elemental image. So the quad's corners store the linear parts, which Cycles
interpolates, and the material only rounds, adds and multiplies; ``tests/support/card_rays.py`` repeats it. Elemental
images are counted along the rows of their lattice, in which neighbours are nearest, and from row to row along a second,
perpendicular axis: the nearest centre is then in the row below the place or above it.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.panel.subpixel_rays import (
    PERIOD,
    Geometry,
    PanelLayout,
    elemental_lattice,
    elemental_waves,
    short_steps,
    subpixel_table,
)
from lfsr_core.optics.rays import MIN_SIZE, RIM, UNIT

STRAIGHT = 1e-9  # of a pitch: rows of a lattice that are shifted by less are not shifted
PARTS = 3  # subpixels of a pixel


class Rows(NamedTuple):
    """A lattice as rows of points; lengths are pitches within a row."""

    shift: float  # from each row to the next, 0 where the nearest point is found along each axis alone
    square: float  # the distance between rows, squared


class Linear(NamedTuple):
    """A quantity that is linear in the place on the panel."""

    corners: Array  # (4, 2) at the corners of the quad
    per_pixel: Array  # (2, 2): columns are the change per pixel rightwards and upwards


@dataclasses.dataclass(frozen=True)
class PanelCard:
    """The quad and the material's constants; scene units, +X right, +Y up, seen from the camera."""

    pixel: float  # side of the image's pixels on the card
    corners: Array  # (4, 2) around the card's centre: upper left, lower left, lower right, upper right
    places: Array  # (4, 2) thirds of pixels from the panel's left edge, rows of pixels from its lower edge
    mixes: bool  # whether a pixel of the image shows three subpixels: a ray takes that at its place, and its colour
    counts: Linear  # elemental images: along a row, and rows; whole at their centres
    starts: Linear  # where rays begin on the camera plane
    ways: Linear  # from there to the display plane
    images: Rows
    lenses: Rows
    # (2, 2), columns: what a count away from the centre of the elemental image adds
    start_steps: Array
    way_steps: Array
    lens_steps: Array  # the same on the display plane, of the random point on the lens
    # (PERIOD, 3 * PERIOD, 3) for each third of a pixel, rows from the bottom: pixels (x, y) from its lower left corner
    # to that of its subpixel, and the channel (0 red … 2 blue); zeros if a subpixel shows all three
    table: Array
    # Pixels by which a subpixel is larger than a third of the pixel; None where it is that third.
    stretch: tuple[float, float] | None

    @property
    def spreads(self) -> bool:
        """Whether a subpixel's rays cross its lens at different places."""
        return bool(self.lens_steps.any())


def panel_card(layout: PanelLayout, radius: float = math.inf, of_subpixels: bool = True) -> PanelCard:
    """Return the card of ``layout``, within ``radius`` of its centre.

    The image has a pixel for each subpixel, or for each pixel of the panel if not ``of_subpixels``. A pixel is as large
    as what a subpixel lights on the display plane if the radius allows it (see ``lens_card``).
    """
    display, array = layout.display, layout.array
    geometry = Geometry.of(display)
    # In millimetres; matrices (2, 2) act on columns. From a place on the panel: the counts of elemental images (waves,
    # phases), where its ray crosses the lenses without the steps (lens), and where it begins on the camera plane.
    if cylinders := display.lenticular:
        waves, phases = elemental_waves(display)
        zone, nearer = display.views[0] * geometry.spacing, geometry.nearer
        (across, along), none = np.array(cylinders.directions), np.zeros(2)
        lens, lens_shift, start, start_shift = np.eye(2) * nearer, none, np.zeros((2, 2)), none
        images = lenses = Rows(0, 1)
        start_steps = np.array([[zone if cylinders.reversed else -zone, 0], [0, 0]])
        # Perpendicular to the axes a ray passes through its cylinder's axis; along them it goes straight on.
        step = along * zone * -along[0] * (1 - nearer) - across * cylinders.pitch_mm * nearer
        end_steps = np.stack([step, none], -1)
        lens_steps = np.stack([across * cylinders.pitch_mm * nearer, none], -1)
        # Size of the area that a subpixel lights on the plane of the lenses.
        extent = math.hypot(1, cylinders.slant) * cylinders.pitch_mm * nearer, geometry.pixel[1] * nearer
    else:
        sheet = display.lenslet
        assert sheet is not None
        throw, elemental = geometry.distance / geometry.gap, elemental_lattice(sheet, geometry)
        matrix, images_matrix = sheet.lenses.matrix(sheet.packing), elemental.matrix(sheet.packing)
        short = short_steps(images_matrix)
        steps, images = _by_rows(images_matrix @ short)
        lens_steps, lenses = _by_rows(matrix @ short_steps(matrix))
        waves = np.linalg.inv(steps)
        phases = waves @ np.array(elemental.shift_mm)
        counted = matrix @ short @ [[1, -images.shift], [0, 1]]  # a lens's place by the count of its elemental image
        lens, lens_shift = counted @ waves, sheet.lenses.shift_mm - counted @ phases
        start, start_shift = lens * (1 + throw) - np.eye(2) * throw, lens_shift * (1 + throw)
        start_steps, end_steps, extent = -counted * (1 + throw), -counted, sheet.lenses.pitch_mm
    end_units = np.array([2 * array.half_width, 2 * array.half_height]) / geometry.lens_plane
    start_unit, pitch = array.spacing / geometry.spacing, np.diag(geometry.pixel)
    panel = np.array(display.panel_pixels)
    size = panel * (display.pixel_layout.count if of_subpixels else 1, 1)
    pixel = float(np.mean(np.multiply(extent, end_units)))
    pixel *= min(1, max(MIN_SIZE, radius / pixel / (math.hypot(*size) / 2)))
    # Corners (4, 2) in pixels of the image, from its upper left corner; then of the panel, from its lower left one.
    places = UNIT * size + RIM * (2 * UNIT - 1)
    shown = (places / size - 0.5) * (1, -1) * np.where(display.flip, -1, 1) * panel
    starts, ends = start * start_unit, end_units[:, None] * lens
    ways, millimetres = ends - starts, shown @ pitch
    wide, high = display.pixel_layout.size
    table = np.zeros((PERIOD, PERIOD * PARTS, 3))
    if display.pixel_layout.count > 1:
        # The panel's subpixels from left to right, where its image is mirrored too.
        right, up, channel = (values[:, :, ::-1 if display.flip[0] else 1] for values in subpixel_table(layout))
        third = np.arange(PARTS) / PARTS
        table = np.stack([right + (1 - wide) / 2 - third, up + (1 - high) / 2, channel], -1).reshape(table.shape)
    return PanelCard(
        pixel=pixel, corners=(places - size / 2) * (1, -1) * pixel,
        places=(shown + panel / 2) * (PARTS, 1), mixes=not of_subpixels and display.pixel_layout.count > 1,
        counts=Linear(millimetres @ waves.T - phases, waves @ pitch),
        starts=Linear(millimetres @ starts.T + start_shift * start_unit, starts @ pitch),
        ways=Linear(millimetres @ ways.T + lens_shift * end_units - start_shift * start_unit, ways @ pitch),
        images=images, lenses=lenses, start_steps=start_steps * start_unit,
        way_steps=end_units[:, None] * end_steps - start_steps * start_unit,
        lens_steps=end_units[:, None] * lens_steps * layout.aperture,
        table=table, stretch=(wide - 1 / PARTS, high - 1) if display.pixel_layout.cells else None)


def _by_rows(matrix: Array) -> tuple[Array, Rows]:
    """(2, 2): the step within a row of a lattice, and the perpendicular one to the next row; and its rows."""
    along, up = matrix.T
    shift = float(along @ up / (along @ along))
    square = up - shift * along
    return np.stack([along, square], -1), Rows(shift if abs(shift) > STRAIGHT else 0.0,
                                               float(square @ square / (along @ along)))
