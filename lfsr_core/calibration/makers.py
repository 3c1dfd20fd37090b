"""Display profiles from makers' calibrations: ``visual.json`` of Looking Glass displays, three numbers of CubeVi C1s.

In a visual.json most numbers are wrapped, as in ``"pitch": {"value": 52.6}``; the third generation adds cells of
subpixels as plain numbers. For x and y from 0 to 1 from the lower left and channel c, the first two generations state
a = (x + c / (3·screenW) + y·tilt)·P − center: their stripes begin at the pixel's centre, ours a third of a pixel
earlier. If a calibration mirrors the image left-right, its coordinates are those of the image; if up-down, those of
the panel, which shows it upside down. ``invView`` is read and not used: since HoloPlay Core the vendor's shader has
view 1 − fract(a) for every device.

For the pixel in column i and row j from the top, both from 1, and channel c = 0, 1, 2, CubeVi's shaders state
fract((3·(i + j·slope) + c + x0) / interval), in subpixels: 0 at the left border of a cylinder, 1 at its right one,
which is seen from the left.
"""

import codecs
import contextlib
import dataclasses
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import check_within
from lfsr_core.base.system import MOST_JSON_BYTES, parse_json, read_bytes
from lfsr_core.optics.display import MAX_OFFSET, MAX_SLANT, DisplayProfile, Lenticular, Subpixels, proposed_light_field

INCH = 25.4
# Quilts by the panel's pixels and by whether it has cells, which the third generation has. A 16-inch and a 15.6-inch
# display of earlier generations have the same quilt. See exports.options.PRESETS.
QUILTS = {((1536, 2048), False): (8, 6, 420, 560), ((1440, 2560), False): (11, 6, 372, 682),
          ((2560, 1600), False): (5, 9, 819, 455), ((3840, 2160), False): (5, 9, 819, 455),
          ((3840, 2160), True): (7, 7, 857, 857), ((2160, 3840), True): (11, 6, 545, 1000),
          ((7680, 4320), True): (7, 7, 1170, 1170), ((4320, 7680), True): (11, 6, 744, 1364)}
# The rule for a pixel's cell, by a calibration's mode as older programs read it; other programs differ.
RULES = {0: "0", 1: "(x+y)%2", 2: "x%2", 3: "(y+2(x%2))%4", 4: "y%2"}
OFFSETS = tuple(f"{channel}Offset{axis}" for channel in "RGB" for axis in "XY")
CONE, DISTANCE_BY_HEIGHT = 40.0, 2.5  # if the calibration does not state them
REQUIRED = ("pitch", "slope", "center", "DPI", "screenW", "screenH")
OPTIONAL = {"viewCone": CONE, "invView": 1.0, "verticalAngle": 0.0, "flipImageX": 0.0, "flipImageY": 0.0,
            "flipSubp": 0.0, "fringe": 0.0}
# Of CubeVi C1s, whose panel has 5.7 inches; the interval is in subpixels.
C1_PIXELS, C1_PIXEL_MM, C1_VIEWS = (1440, 2560), 0.0493, 40
# Least and most of every number of every kind of calibration: of all generations, of cells, and of C1s.
RANGES = {name: (-1e9, 1e9) for name in OPTIONAL} | {
    "pitch": (0.1, 1e4), "slope": (-1e4, 1e4), "center": (-1e4, 1e4), "DPI": (1.0, 1e5), "screenW": (1, 1e5),
    "screenH": (1, 1e5), "viewCone": (0.0, 180.0)} | dict.fromkeys(OFFSETS, (-MAX_OFFSET, MAX_OFFSET)) | {
    "slope (obliquity)": (-MAX_SLANT, MAX_SLANT), "interval (lineNumber)": (6.0, 200.0), "x0 (deviation)": (-1e4, 1e4)}


@dataclasses.dataclass(frozen=True)
class Calibration:
    """The numbers of a visual.json under its own names; see docs/reference/displays.md."""

    numbers: Mapping[str, float]  # every name of REQUIRED and OPTIONAL
    mode: int  # CellPatternMode
    cells: tuple[tuple[float, ...], ...]  # offsets in the order of OFFSETS, in pixels
    serial: str


def read_calibration(path: str | Path) -> Calibration:
    """Read a visual.json; LfsrError names the field, its value and what was expected."""
    what = "the visual.json of a display"
    content = read_bytes(path, what, MOST_JSON_BYTES)
    try:
        if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):  # PowerShell's
            content = content.decode("utf-16").encode()
        data = parse_json(content.removeprefix(codecs.BOM_UTF8))  # Windows programs begin with this mark
    except ValueError as error:
        raise LfsrError(f"{path} cannot be read as {what} ({error}): copy it from the display again") from None
    return calibration_of(data, path)


def calibration_of(data: Any, path: str | Path) -> Calibration:
    """Return the one calibration in JSON data, which errors call ``path``; LfsrError as of ``read_calibration``."""
    records = list(_calibrations(data))
    if len(records) > 1:
        raise LfsrError(f"{path} holds the calibrations of {len(records)} displays, expected one: keep one of them")
    data = records[0] if records else data
    if not isinstance(data, dict):
        raise LfsrError(f"{path} holds no JSON object with the numbers of a display: copy the calibration again")
    numbers = {name: _number(path, data, name, None) for name in REQUIRED}
    numbers |= {name: _number(path, data, name, value) for name, value in OPTIONAL.items()}
    for name in ("screenW", "screenH"):
        _check(path, name, numbers[name], numbers[name] == int(numbers[name]), "a whole number of pixels")
    _check(path, "slope", numbers["slope"], abs(numbers["slope"]) >= 1e-3, "a number other than 0")
    mode = _unwrapped(data.get("CellPatternMode", data.get("cellPatternMode", 0)))
    _check(path, "CellPatternMode", mode, isinstance(mode, (int, float)) and mode in RULES, "one of 0, 1, 2, 3, 4")
    cells = _unwrapped(data.get("subpixelCells")) or []
    _check(path, "subpixelCells", cells, isinstance(cells, list) and all(isinstance(cell, dict) for cell in cells),
           "a list of objects")
    offsets = tuple(tuple(_number(path, cell, name, None) for name in OFFSETS) for cell in cells)
    return Calibration(numbers, int(mode), offsets, str(data.get("serial", "")))


def _calibrations(data: Any) -> Iterator[dict[str, Any]]:
    """Yield the objects with a pitch in ``data``; Bridge wraps them in other objects, and in text."""
    if isinstance(data, str) and data.lstrip().startswith("{"):
        with contextlib.suppress(ValueError):
            data = parse_json(data.encode())
    if isinstance(data, dict) and "pitch" in data:
        yield data
    elif isinstance(data, (dict, list)):
        for inside in data.values() if isinstance(data, dict) else data:
            yield from _calibrations(inside)


def profile_from_calibration(calibration: Calibration, name: str) -> DisplayProfile:
    """Return the display profile of a calibration, with the light field that loses nothing on the display."""
    numbers = calibration.numbers
    mirrored, upside_down, bgr = (numbers[switch] >= 0.5 for switch in ("flipImageX", "flipImageY", "flipSubp"))
    width, height = numbers["screenW"], numbers["screenH"]
    pixels, panel_mm = (int(width), int(height)), (width / numbers["DPI"] * INCH, height / numbers["DPI"] * INCH)
    tilt = height / (width * numbers["slope"])  # panel heights by which an axis leans per panel width
    sheet = Lenticular(INCH / numbers["pitch"], (-tilt if mirrored else tilt) * width / height, numbers["center"])
    if calibration.cells:
        subpixels = Subpixels(cells=calibration.cells, cell_rule=RULES[calibration.mode])
    else:
        # Without flips the stripes begin with red; two flips cancel.
        subpixels = Subpixels("rgb" if mirrored == bgr else "bgr")
        third = (1 if mirrored == bgr else -1) / (3 * pixels[0])
        sheet = dataclasses.replace(sheet, center=sheet.center - third * sheet.lenses_across(panel_mm[0]))
    if upside_down:
        # Sheet and subpixels with y measured from the panel's other end.
        lean = sheet.slant * panel_mm[1] / panel_mm[0] * sheet.lenses_across(panel_mm[0])  # over its height, in pitches
        sheet = dataclasses.replace(sheet, slant=-sheet.slant, center=sheet.center - lean, flip=(False, True))
        rule, cells = subpixels.cell_rule, subpixels.cells
        if "y" in rule and cells:
            count = int(rule[-1])
            cells = tuple(cells[(pixels[1] - 1 - number) % count] for number in range(count))
        subpixels = dataclasses.replace(subpixels, cells=tuple(
            tuple(-value if axis % 2 else value for axis, value in enumerate(cell)) for cell in cells))
    lenses, views = proposed_light_field(pixels, panel_mm, sheet)
    serial = f" {calibration.serial}" if calibration.serial else ""
    return DisplayProfile(
        name, pixels, panel_mm, lenses, views, DISTANCE_BY_HEIGHT * panel_mm[1], numbers["viewCone"] or CONE,
        ei_order="direct", quilt=QUILTS.get((pixels, bool(calibration.cells))),
        description=f"Lenticular display{serial}, from its calibration.", subpixels=subpixels, lenticular=sheet)


def profile_of_c1(slope: float, interval: float, x0: float, name: str = "cubevi-c1") -> DisplayProfile:
    """Return the profile of a C1 whose programs show these numbers; LfsrError for impossible ones."""
    for field, value in (("slope (obliquity)", slope), ("interval (lineNumber)", interval), ("x0 (deviation)", x0)):
        check_within(field, value, *RANGES[field])
    panel_mm = C1_PIXELS[0] * C1_PIXEL_MM, C1_PIXELS[1] * C1_PIXEL_MM
    # Our stripes begin a third of a pixel earlier, pixels are counted from 0 and rows from the bottom.
    center = -(x0 + 2.5 + 3 * (C1_PIXELS[1] + 0.5) * slope) / interval
    sheet = Lenticular(interval / 3 * C1_PIXEL_MM * math.cos(math.atan(slope)), -slope, center % 1)
    lenses, _ = proposed_light_field(C1_PIXELS, panel_mm, sheet)
    return DisplayProfile(
        name, C1_PIXELS, panel_mm, lenses, (C1_VIEWS, 1), DISTANCE_BY_HEIGHT * panel_mm[1], CONE, ei_order="direct",
        description=f"CubeVi C1 of slope {slope:g}, interval {interval:g}, x0 {x0:g}.", subpixels=Subpixels("rgb"),
        lenticular=sheet)


def _number(path: str | Path, data: Mapping[str, Any], name: str, default: float | None) -> float:
    value = _unwrapped(data.get(name))
    value = default if value is None else float(value) if isinstance(value, bool) and name in OPTIONAL else value
    if value is None:
        raise LfsrError(f"{path}: field {name!r} is missing; every calibration needs it")
    least, most = RANGES[name]
    _check(path, name, value, isinstance(value, (int, float)) and not isinstance(value, bool)
           and least <= value <= most, f"a number from {least:g} to {most:g}")
    return float(value)


def _unwrapped(value: Any) -> Any:
    return value.get("value") if isinstance(value, dict) else value


def _check(path: str | Path, name: str, value: Any, holds: bool, rule: str) -> None:
    if not holds:
        raise LfsrError(f"{path}: {name} is {repr(value)[:50]}, but it must be {rule}")
