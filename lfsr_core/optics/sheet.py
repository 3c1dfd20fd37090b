"""Lens sheets of fractional pitch, and the subpixel layout of the panel.

Millimetres from the panel's centre as a viewer sees it: x rightwards, y upwards, unless stated otherwise.
Lattices follow LeksiDor's LFDisplay, lenticular figures the calibrations of Looking Glass displays.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.records import check_choice, check_within, fail

STRIPES = ("rgb", "bgr", "white")
PACKINGS = ("square", "hexagonal")
# Cell of the pixel in column x, row y (from the bottom). Sources disagree on the meaning of a device's mode.
CELL_RULES = ("0", "(x+y)%2", "x%2", "y%2", "y%4", "(y+2(x%2))%4")
CELL_SIDE = 1 / math.sqrt(3)  # of a subpixel in a cell: a square, as calibrations do not tell its shape
MAX_CELLS = 4
MAX_OFFSET = 2.0  # pixels between a pixel's centre and its subpixels
MIN_MM, MAX_MM = 1e-3, 1e5
MAX_SLANT = 2.0


@dataclasses.dataclass(frozen=True)
class Subpixels:
    """Where the red, green and blue subpixel of a pixel lie."""

    # "rgb", "bgr": thirds of the pixel from left to right; "white": all three over the whole pixel
    stripes: str = "rgb"
    # instead of stripes: per cell the offsets (R x, R y, G x, G y, B x, B y) from the pixel's centre, in pixels, y up
    cells: tuple[tuple[float, ...], ...] = ()
    cell_rule: str = "0"  # one of CELL_RULES: which cell a pixel has

    def __post_init__(self) -> None:
        check_choice("subpixels.stripes", self.stripes, STRIPES)
        check_choice("subpixels.cell_rule", self.cell_rule, CELL_RULES)
        for cell in self.cells:
            if len(cell) != 6 or not all(abs(value) <= MAX_OFFSET for value in cell):
                fail("subpixels.cells", cell, "a cell has six offsets R x, R y, G x, G y, B x, B y of at most "
                                              f"{MAX_OFFSET:g} pixels")
        needed = int(cell_of(self.cell_rule, np.arange(4)[:, None], np.arange(4)[None]).max()) + 1
        if len(self.cells) > MAX_CELLS or (self.cells and needed > len(self.cells)):
            fail("subpixels.cell_rule", self.cell_rule, f"it needs {needed} cells and there are {len(self.cells)}, of "
                                                        f"at most {MAX_CELLS}")

    def offsets(self, channel: int, rows_from_bottom: Array, columns: Array) -> tuple[Array, Array]:
        """Offsets (x, y), in pixels, y up, from the centres of pixels to their subpixels of one channel.

        ``rows_from_bottom`` (n, 1), ``columns`` (m,) -> two arrays that broadcast to (n, m).
        """
        if not self.cells:
            across = {"rgb": channel - 1, "bgr": 1 - channel, "white": 0}[self.stripes] / 3
            return np.array(across), np.array(0.0)
        cell = cell_of(self.cell_rule, rows_from_bottom, columns)
        table = np.asarray(self.cells, float)
        return table[cell, 2 * channel], table[cell, 2 * channel + 1]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of a subpixel in pixels: the whole pixel, or a third of its area."""
        if self.cells:
            return CELL_SIDE, CELL_SIDE
        return (1.0 if self.stripes == "white" else 1 / 3), 1.0

    @property
    def count(self) -> int:
        """Subpixels of a pixel; 1 if one shows all three colours."""
        return 1 if self.size == (1.0, 1.0) else 3


@dataclasses.dataclass(frozen=True)
class Lenticular:
    """A sheet of slanted cylinders, measured on the panel as a viewer at the viewing distance sees it."""

    pitch_mm: float  # between the axes of neighbouring cylinders, perpendicular to them
    # pixels to the left by which an axis leans per pixel upwards, 1 / slope of a calibration; 0: upright
    slant: float = 0.0
    center: float = 0.0  # pitches from the panel's lower left corner to the next border between two cylinders
    flip: tuple[bool, bool] = (False, False)  # whether the panel shows its image mirrored, (left-right, up-down)
    reversed: bool = False  # whether the views under a cylinder run opposite to those of a lens

    def __post_init__(self) -> None:
        _check_length("lenticular.pitch_mm", self.pitch_mm)
        check_within("lenticular.slant", self.slant, -MAX_SLANT, MAX_SLANT)
        check_within("lenticular.center", self.center, -1e6, 1e6)

    @property
    def pitches(self) -> tuple[float, ...]:
        """Lens pitch in millimetres."""
        return (self.pitch_mm,)

    @property
    def directions(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Unit vectors (x, y) perpendicular to the axes, and along them."""
        long = math.hypot(1, self.slant)
        return (1 / long, self.slant / long), (-self.slant / long, 1 / long)

    def lenses_across(self, width_mm: float) -> float:
        """Number of cylinders that a row of the panel crosses: the pitch along a row is longer than across."""
        return width_mm / self.pitch_mm * math.cos(math.atan(self.slant))


@dataclasses.dataclass(frozen=True)
class Lattice:
    """Points in regular rows: matrix · (i, j) + shift."""

    pitch_mm: tuple[float, float]  # between neighbours in a row, and between rows
    rotation_deg: float = 0.0  # counter-clockwise for the viewer
    shear: float = 0.0  # millimetres by which a row is further right per millimetre up
    shift_mm: tuple[float, float] = (0.0, 0.0)  # from the panel's centre to one of the points

    def __post_init__(self) -> None:
        for value in self.pitch_mm:
            _check_length("pitch_mm", value)
        check_within("rotation_deg", self.rotation_deg, -90, 90)
        check_within("shear", self.shear, -1, 1)
        for value in self.shift_mm:
            check_within("shift_mm", value, -MAX_MM, MAX_MM)

    def matrix(self, packing: str) -> Array:
        """(2, 2): its columns are the steps to the next point of a row and to the next row."""
        across, up = self.pitch_mm
        plain = np.array([[across, across / 2 if packing == "hexagonal" else 0.0], [0.0, up]])
        turn = math.radians(self.rotation_deg)
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        steps: Array = rotation @ np.array([[1.0, self.shear], [0.0, 1.0]]) @ plain
        return steps

    def scaled(self, factor: float) -> Lattice:
        """The lattice enlarged by ``factor`` about the panel's centre."""
        (across, up), (right, above) = self.pitch_mm, self.shift_mm
        return dataclasses.replace(self, pitch_mm=(across * factor, up * factor),
                                   shift_mm=(right * factor, above * factor))


@dataclasses.dataclass(frozen=True)
class Lenslet:
    """A sheet of small lenses."""

    lenses: Lattice  # their centres
    packing: str = "square"  # one of PACKINGS
    gap_mm: float | None = None  # from the panel to the lenses; None: an elemental image fills the viewing angle
    # centres of the elemental images on the panel; None: the lenses as seen from the middle of the viewing zone
    elemental_images: Lattice | None = None

    def __post_init__(self) -> None:
        check_choice("lenslet.packing", self.packing, PACKINGS)
        if self.gap_mm is not None:
            _check_length("lenslet.gap_mm", self.gap_mm)

    @property
    def pitches(self) -> tuple[float, ...]:
        """Lens pitch in a row, and between rows, in millimetres."""
        return self.lenses.pitch_mm


Sheet = Lenslet | Lenticular


def cell_of(rule: str, rows_from_bottom: Array, columns: Array) -> Array:
    """Number of the cell of each pixel under one of CELL_RULES; shapes broadcast."""
    x, y = np.broadcast_arrays(columns, rows_from_bottom)
    cells: Array = {"0": 0 * x, "(x+y)%2": (x + y) % 2, "x%2": x % 2, "y%2": y % 2, "y%4": y % 4,
                    "(y+2(x%2))%4": (y + 2 * (x % 2)) % 4}[rule]
    return cells


def _check_length(field: str, value: float) -> None:
    if not MIN_MM <= value <= MAX_MM:
        fail(field, value, f"it must be a length from {MIN_MM:g} to {MAX_MM:g} millimetres")
