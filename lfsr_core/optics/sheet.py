"""What lies on a panel as it is: its subpixels and the lens sheet before it, whose pitch is no whole number of pixels.

Millimetres as a viewer sees the panel: x rightwards, y upwards, from its centre unless said otherwise.
Lattices after LeksiDor's LFDisplay, lenticular figures after the calibrations of Looking Glass displays.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError

STRIPES = ("rgb", "bgr", "white")
PACKINGS = ("square", "hexagonal")
# Which cell the pixel in column x, row y (from the bottom) has. Sources disagree on what a device's mode means.
CELL_RULES = ("0", "(x+y)%2", "x%2", "y%2", "y%4", "(y+2(x%2))%4")
MOST_CELLS = 4
MOST_OFFSET = 2.0  # pixels between a pixel's centre and its subpixels
LEAST_MM, MOST_MM = 1e-3, 1e5
LEAST_LENS_PIXELS = 1.0
MOST_SLANT = 2.0


@dataclasses.dataclass(frozen=True)
class Subpixels:
    """Where the red, green and blue part of a pixel lie."""

    # "rgb", "bgr": thirds of the pixel from left to right; "white": all three over the whole pixel
    stripes: str = "rgb"
    # instead of stripes: per cell the offsets (R x, R y, G x, G y, B x, B y) from the pixel's centre, in pixels, y up
    cells: tuple[tuple[float, ...], ...] = ()
    cell_rule: str = "0"  # of CELL_RULES: which cell a pixel has

    def __post_init__(self) -> None:
        _choice("subpixels.stripes", self.stripes, STRIPES)
        _choice("subpixels.cell_rule", self.cell_rule, CELL_RULES)
        for cell in self.cells:
            if len(cell) != 6 or not all(abs(value) <= MOST_OFFSET for value in cell):
                fail("subpixels.cells", cell, "a cell has six offsets R x, R y, G x, G y, B x, B y of at most "
                                              f"{MOST_OFFSET:g} pixels")
        needed = int(cell_of(self.cell_rule, np.arange(4)[:, None], np.arange(4)[None]).max()) + 1
        if len(self.cells) > MOST_CELLS or (self.cells and needed > len(self.cells)):
            fail("subpixels.cell_rule", self.cell_rule, f"it needs {needed} cells and there are {len(self.cells)}, of "
                                                        f"at most {MOST_CELLS}")

    def offsets(self, channel: int, rows_from_bottom: Array, columns: Array) -> tuple[Array, Array]:
        """(x, y) in pixels, y up, from the centres of pixels to their subpixel of a channel.

        ``rows_from_bottom`` (n, 1), ``columns`` (m,) -> two arrays that broadcast to (n, m).
        """
        if not self.cells:
            across = {"rgb": channel - 1, "bgr": 1 - channel, "white": 0}[self.stripes] / 3
            return np.float64(across), np.float64(0)
        cell = cell_of(self.cell_rule, rows_from_bottom, columns)
        table = np.asarray(self.cells, float)
        return table[cell, 2 * channel], table[cell, 2 * channel + 1]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of a subpixel in pixels: a third of a pixel's area where it has three."""
        return (1.0, 1.0) if self.stripes == "white" and not self.cells else (1 / 3, 1.0) if not self.cells else (
            CELL_SIDE, CELL_SIDE)


CELL_SIDE = 1 / math.sqrt(3)  # of a subpixel in a cell, whose shape no calibration says: a square of the same area


@dataclasses.dataclass(frozen=True)
class Lenticular:
    """A sheet of slanted cylinders. As a viewer at the viewing distance sees it, on the panel."""

    pitch_mm: float  # between the axes of neighbouring cylinders, square to them
    # pixels to the left by which an axis leans per pixel upwards, 1 / slope of a calibration; 0: upright
    slant: float = 0.0
    center: float = 0.0  # share of a pitch from the panel's lower left corner to the next border of two cylinders
    flip: tuple[bool, bool] = (False, False)  # whether the panel shows its image mirrored, (left-right, up-down)
    reversed: bool = False  # whether the views under a cylinder run the other way, as no lens makes them

    def __post_init__(self) -> None:
        _length("lenticular.pitch_mm", self.pitch_mm)
        _within("lenticular.slant", self.slant, -MOST_SLANT, MOST_SLANT)
        _within("lenticular.center", self.center, -1e6, 1e6)

    def lenses_across(self, width_mm: float) -> float:
        """Cylinders that a row of the panel crosses, P of RESEARCH: the pitch along a row is longer than across."""
        return width_mm / self.pitch_mm * math.cos(math.atan(self.slant))


@dataclasses.dataclass(frozen=True)
class Lattice:
    """Points in regular rows: matrix · (i, j) + shift."""

    pitch_mm: tuple[float, float]  # between neighbours in a row, and between rows
    rotation_deg: float = 0.0  # counter-clockwise for the viewer
    shear: float = 0.0  # by which a row is further right per millimetre up
    shift_mm: tuple[float, float] = (0.0, 0.0)  # from the panel's centre to one of the points

    def __post_init__(self) -> None:
        for value in self.pitch_mm:
            _length("pitch_mm", value)
        _within("rotation_deg", self.rotation_deg, -90, 90)
        _within("shear", self.shear, -1, 1)
        for value in self.shift_mm:
            _within("shift_mm", value, -MOST_MM, MOST_MM)

    def matrix(self, packing: str) -> Array:
        """(2, 2): columns are the steps to the next point in the row and to the next row; hexagonal: half a step on."""
        across, up = self.pitch_mm
        plain = np.array([[across, across / 2 if packing == "hexagonal" else 0.0], [0.0, up]])
        turn = math.radians(self.rotation_deg)
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        return rotation @ np.array([[1.0, self.shear], [0.0, 1.0]]) @ plain

    def scaled(self, factor: float) -> Lattice:
        """The lattice seen from a point above the panel's centre on a plane ``factor`` times as far."""
        pitch, shift = (tuple(value * factor for value in pair) for pair in (self.pitch_mm, self.shift_mm))
        return dataclasses.replace(self, pitch_mm=pitch, shift_mm=shift)


@dataclasses.dataclass(frozen=True)
class Lenslet:
    """A sheet of small lenses."""

    lenses: Lattice  # their centres
    packing: str = "square"  # of PACKINGS
    gap_mm: float | None = None  # from the panel to the lenses, None for what gives the viewing angle
    # where their elemental images lie on the panel; None: where they are seen from the middle of the viewing zone
    elemental_images: Lattice | None = None

    def __post_init__(self) -> None:
        _choice("lenslet.packing", self.packing, PACKINGS)
        if self.gap_mm is not None:
            _length("lenslet.gap_mm", self.gap_mm)


def cell_of(rule: str, rows_from_bottom: Array, columns: Array) -> Array:
    """Number of the cell that pixels have by one of CELL_RULES; shapes broadcast."""
    x, y = np.asarray(columns), np.asarray(rows_from_bottom)
    return {"0": 0 * (x + y), "(x+y)%2": (x + y) % 2, "x%2": x % 2 + 0 * y, "y%2": y % 2 + 0 * x, "y%4": y % 4 + 0 * x,
            "(y+2(x%2))%4": (y + 2 * (x % 2)) % 4}[rule]


def fail(field: str, value: Any, rule: str) -> None:
    """LfsrError that names a field, its value and the rule that it breaks."""
    raise LfsrError(f"{field} is {repr(value)[:100]}, but {rule}")


def _choice(field: str, value: Any, choices: tuple[str, ...]) -> None:
    if value not in choices:
        fail(field, value, f"it must be one of {', '.join(choices)}")


def _length(field: str, value: float) -> None:
    if not LEAST_MM <= value <= MOST_MM:
        fail(field, value, f"it must be a length from {LEAST_MM:g} to {MOST_MM:g} millimetres")


def _within(field: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        fail(field, value, f"it must be from {least:g} to {most:g}")
