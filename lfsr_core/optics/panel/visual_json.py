"""Display profiles from calibrations of Looking Glass displays, ``visual.json``.

Most numbers are wrapped, as in ``"pitch": {"value": 52.6}``; the third generation adds cells of subpixels as plain
numbers. For x and y from 0 to 1 from the lower left and channel c, the first two generations state
a = (x + c / (3·screenW) + y·tilt)·P − center: their stripes begin at the pixel's centre, ours a third of a pixel
earlier. If a calibration mirrors the image, its coordinates are those of the image.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.proposal import PanelShape, proposed_light_field
from lfsr_core.optics.sheet import Lenticular, Subpixels

INCH = 25.4
# The rule for a pixel's cell, by a calibration's mode as older programs read it; other programs differ.
RULES = {0: "0", 1: "(x+y)%2", 2: "x%2", 3: "(y+2(x%2))%4", 4: "y%2"}
OFFSETS = tuple(f"{channel}Offset{axis}" for channel in "RGB" for axis in "XY")
CONE, DISTANCE_BY_HEIGHT = 40.0, 2.5  # if the calibration does not state them
REQUIRED = ("pitch", "slope", "center", "DPI", "screenW", "screenH")
OPTIONAL = {"viewCone": CONE, "invView": 1.0, "verticalAngle": 0.0, "flipImageX": 0.0, "flipImageY": 0.0,
            "flipSubp": 0.0, "fringe": 0.0}


@dataclasses.dataclass(frozen=True)
class Calibration:
    """The numbers of a visual.json under its own names; see docs/reference/displays.md."""

    numbers: Mapping[str, float]  # every name of REQUIRED and OPTIONAL
    mode: int  # CellPatternMode
    cells: tuple[tuple[float, ...], ...]  # offsets in the order of OFFSETS, in pixels
    serial: str


def read_calibration(path: str | Path) -> Calibration:
    """Read a visual.json; LfsrError names the field, its value and what was expected."""
    data = read_json(path, "the visual.json of a display")
    if not isinstance(data, dict):
        raise LfsrError(f"{path} holds a {type(data).__name__}, but a calibration is a JSON object: check the path")
    numbers = {name: _number(path, data, name, None) for name in REQUIRED}
    numbers |= {name: _number(path, data, name, value) for name, value in OPTIONAL.items()}
    for name in ("pitch", "DPI", "screenW", "screenH"):
        _check(path, name, numbers[name], numbers[name] > 0, "a number above 0")
    for name in ("screenW", "screenH"):
        _check(path, name, numbers[name], numbers[name] == int(numbers[name]), "a whole number of pixels")
    _check(path, "slope", numbers["slope"], numbers["slope"] != 0, "a number other than 0")
    mode: Any = data.get("CellPatternMode", data.get("cellPatternMode", 0))
    mode = mode.get("value") if isinstance(mode, dict) else mode
    _check(path, "CellPatternMode", mode, isinstance(mode, (int, float)) and mode in RULES, "one of 0, 1, 2, 3, 4")
    return Calibration(numbers, int(mode), _cells(path, data.get("subpixelCells") or []), str(data.get("serial", "")))


def profile_from_calibration(calibration: Calibration, name: str) -> DisplayProfile:
    """Return the display profile of a calibration, with the light field that loses nothing on the display."""
    numbers = calibration.numbers
    mirrored, bgr, inverted = (numbers[switch] >= 0.5 for switch in ("flipImageX", "flipSubp", "invView"))
    width, height = numbers["screenW"], numbers["screenH"]
    pixels, panel_mm = (int(width), int(height)), (width / numbers["DPI"] * INCH, height / numbers["DPI"] * INCH)
    tilt = height / (width * numbers["slope"])  # panel heights by which an axis leans per panel width
    sheet = Lenticular(INCH / numbers["pitch"], (-tilt if mirrored else tilt) * width / height, numbers["center"],
                       reversed=not inverted)
    if calibration.cells:
        subpixels = Subpixels(cells=calibration.cells, cell_rule=RULES[calibration.mode])
    else:
        # Without flips the stripes begin with red; two flips cancel.
        subpixels = Subpixels("rgb" if mirrored == bgr else "bgr")
        third = (1 if mirrored == bgr else -1) / (3 * pixels[0])
        sheet = dataclasses.replace(sheet, center=sheet.center - third * sheet.lenses_across(panel_mm[0]))
    lenses, views = proposed_light_field(PanelShape(pixels, panel_mm), sheet)
    serial = f" {calibration.serial}" if calibration.serial else ""
    return DisplayProfile(
        name, pixels, panel_mm, lenses, views, DISTANCE_BY_HEIGHT * panel_mm[1], numbers["viewCone"],
        ei_order="direct", description=f"Lenticular display{serial}, from its calibration.", subpixels=subpixels,
        lenticular=sheet)


def _number(path: str | Path, data: Mapping[str, Any], name: str, default: float | None) -> float:
    value = data.get(name, default)
    value = value.get("value", default) if isinstance(value, dict) else value
    if value is None:
        raise LfsrError(f"{path}: field {name!r} is missing; every calibration needs it")
    _check(path, name, value, isinstance(value, (int, float)) and not isinstance(value, bool), "a number")
    return float(value)


def _cells(path: str | Path, data: Any) -> tuple[tuple[float, ...], ...]:
    _check(path, "subpixelCells", data, isinstance(data, list) and all(isinstance(cell, dict) for cell in data),
           "a list of objects")
    return tuple(tuple(_number(path, cell, name, None) for name in OFFSETS) for cell in data)


def _check(path: str | Path, name: str, value: Any, holds: bool, rule: str) -> None:
    if not holds:
        raise LfsrError(f"{path}: {name} is {repr(value)[:50]}, but it must be {rule}")
