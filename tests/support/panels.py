"""Small panels with lens sheets of every kind."""

import dataclasses
import math

import numpy as np

from lfsr_core.optics.display import DisplayProfile

# Of the first columns of a real third-generation device, see docs/reference/displays.md.
CELLS = ((-0.31, 0.25, 0.28, 0.25, 0.0, -0.25), (-0.31, -0.25, 0.28, -0.25, 0.0, 0.25))


def profile(**changes) -> DisplayProfile:
    """A panel of 240×160 pixels of half a millimetre; ``changes`` say which sheet lies on it."""
    return DisplayProfile.from_dict({
        "format": 2, "name": "panel", "panel_pixels": [240, 160], "panel_mm": [120.0, 80.0],
        "viewing_distance_mm": 300.0, "viewing_angle_deg": 40.0, **changes})


def lenticular(**changes) -> DisplayProfile:
    """Slanted cylinders over red, green and blue stripes."""
    return profile(lenticular={"pitch_mm": 2.7, "slant": -0.15, "center": 0.3}, **changes)


def hexagonal(**changes) -> DisplayProfile:
    """Hexagonal lenses, turned a little, off the centre."""
    lattice = {"pitch_mm": [5.0, 5.0 * math.sqrt(0.75)], "rotation_deg": 0.3, "shift_mm": [0.4, -0.7]}
    return profile(lenslet={"packing": "hexagonal", "lenses": lattice}, **changes)


def square(**changes) -> DisplayProfile:
    """Square lenses, sheared and turned, at a gap of their own."""
    lattice = {"pitch_mm": [5.1, 4.9], "rotation_deg": -2.0, "shear": 0.02}
    return profile(lenslet={"lenses": lattice, "gap_mm": 7.0}, **changes)


def cells(**changes) -> DisplayProfile:
    """A third-generation device: two cells of subpixels that change from column to column."""
    return lenticular(subpixels={"cells": [list(cell) for cell in CELLS], "cell_rule": "x%2"}, **changes)


def large(cells: bool) -> DisplayProfile:
    """An 8K panel under 1,400 cylinders, with cells of subpixels or stripes."""
    slant, width = -0.15, 1439.42
    return profile(panel_pixels=[7680, 4320], panel_mm=[width, width * 9 / 16], viewing_distance_mm=1500.0,
                   lenticular={"pitch_mm": width / 1400 / math.hypot(1, slant), "slant": slant, "center": 0.3},
                   **({"subpixels": {"cells": [list(cell) for cell in CELLS], "cell_rule": "x%2"}} if cells else {}))


def whole(kind: str, **changes) -> DisplayProfile:
    """A sheet with a whole number of pixels behind each lens, as a profile of format 1 has it: 8 by 8, or 8 by 1."""
    given = {"panel_pixels": [128, 96], "panel_mm": [128.0, 96.0], "viewing_distance_mm": 180.0,
             "lenses": [16, 12 if kind == "lenslet" else 96], "views": [8, 8 if kind == "lenslet" else 1]}
    if kind == "lenticular":
        return profile(lenticular={"pitch_mm": 8.0}, **given | changes)
    pitch = 8 * 180 / (180 + 4 / math.tan(math.radians(20)))
    return profile(lenslet={"lenses": {"pitch_mm": [pitch, pitch], "shift_mm": [pitch / 2, pitch / 2]}},
                   **given | changes)


def small(display: DisplayProfile) -> DisplayProfile:
    """A corner of it, with small lenses for so few pixels."""
    return dataclasses.replace(display, panel_pixels=(120, 80), panel_mm=(60.0, 40.0), viewing_distance_mm=150.0,
                               lenses=(24, 40 if display.lenticular else 16), weave="all")


def psnr(first: np.ndarray, second: np.ndarray) -> float:
    """Likeness in decibels of two images of 256 levels."""
    return float(-10 * np.log10((((first.astype(float) - second) / 255) ** 2).mean()))


SHEETS = {"lenticular": lenticular, "hexagonal": hexagonal, "square": square, "cells": cells}
