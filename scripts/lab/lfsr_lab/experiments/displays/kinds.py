"""The displays that are compared: three kinds, in full or cut down to a panel of fewer pixels with the same sheet."""

from __future__ import annotations

import math
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile, load_display

FULL_WIDTH = {"integral": 7680, "lenticular": 3840, "hexagonal": 7680}  # pixels of the real panels
STEP = 192  # pixels: 16:9 panels of whole integral lenses
LENS_PIXELS = 12  # behind an integral lens
HEXAGON_PIXELS, TURN_DEG, SHIFT_MM = 10.37, 0.3, (0.31, -0.17)
PIXEL_MM = 708.4 / 7680
DISTANCE = 1.4  # of the integral and hexagonal displays, in panel widths


def kind(name: str, width: int | None = None) -> DisplayProfile:
    """Return a display of FULL_WIDTH, its panel ``width`` pixels wide, None for the real one.

    A smaller panel keeps pixels, lens pitch, turn, slant, cells and viewing angle; the viewing distance shrinks with
    it, so that the scene's parallax is the same, counted in panel widths. LfsrError for a width that cannot be.
    """
    wide = FULL_WIDTH[name] if width is None else width
    if not STEP <= wide <= FULL_WIDTH[name] or wide % STEP:
        raise LfsrError(f"width is {wide}, but a panel must be a multiple of {STEP} pixels wide, at most "
                        f"{FULL_WIDTH[name]}")
    data = {"integral": _integral, "lenticular": _lenticular, "hexagonal": _hexagonal}[name](wide, wide * 9 // 16)
    return DisplayProfile.from_dict({"name": f"{name}-{wide}", **data})


def _integral(width: int, height: int) -> dict[str, Any]:
    return {**_panel(width, height), "lenses": [width // LENS_PIXELS, height // LENS_PIXELS],
            "views": [LENS_PIXELS, LENS_PIXELS]}


def _hexagonal(width: int, height: int) -> dict[str, Any]:
    pitch = HEXAGON_PIXELS * PIXEL_MM
    lattice = {"pitch_mm": [pitch, pitch * math.sqrt(0.75)], "rotation_deg": TURN_DEG, "shift_mm": list(SHIFT_MM)}
    return {"format": 2, **_panel(width, height), "lenslet": {"packing": "hexagonal", "lenses": lattice}}


def _panel(width: int, height: int) -> dict[str, Any]:
    return {"panel_pixels": [width, height], "panel_mm": [width * PIXEL_MM, height * PIXEL_MM],
            "viewing_distance_mm": DISTANCE * width * PIXEL_MM, "viewing_angle_deg": 40.0}


def _lenticular(width: int, height: int) -> dict[str, Any]:
    """The 16 inch display of the third generation, with the light field that is proposed for the panel."""
    whole = load_display("looking-glass-16-gen3")
    fraction = width / whole.panel_pixels[0]
    data = whole.to_dict() | {"panel_pixels": [width, height], "panel_mm": [side * fraction for side in whole.panel_mm],
                              "viewing_distance_mm": whole.viewing_distance_mm * fraction}
    return {key: value for key, value in data.items() if key not in ("name", "description", "lenses", "views")}
