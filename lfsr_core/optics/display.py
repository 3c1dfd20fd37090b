"""Display profiles: the panel, its lens array and where the viewer stands.

In a profile of format 1 each lens covers a whole number of pixels, and the finished EIA is the panel's image.
A profile of format 2 can describe how a lens sheet lies on the panel (``Sheet``): then lenses and views are
those of a regular light field that is rendered, and the panel's image is woven from its EIA (``panel/weave.py``).

Of sheets and subpixels, millimetres are from the panel's centre as a viewer sees it: x rightwards, y upwards, unless
stated otherwise. Lattices follow LeksiDor's LFDisplay, lenticular figures the calibrations of Looking Glass displays.
"""

import dataclasses
import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, did_you_mean
from lfsr_core.base.records import check_choice, check_within, fail, from_data, to_data
from lfsr_core.base.system import atomic_path, read_bytes, without_advice

PROFILE_FOLDER = Path(__file__).parent / "displays"
EI_ORDERS = ("flipped", "direct")
MAX_MM = 1e9
MAX_NAME, MAX_DESCRIPTION = 100, 1000  # characters
MAX_BYTES = 100_000  # of a profile's file
WEAVES = ("nearest", "views", "all")
VIEWS_PER_SUBPIXEL = 2
MULTIPLE = 4  # of views, so that scales 2 and 4 divide them
MAX_PIXELS = 65536  # a side: Blender renders no more
Pair = tuple[int, int]
STRIPES = ("rgb", "bgr", "white")
PACKINGS = ("square", "hexagonal")
# Cell of the pixel in column x, row y (from the bottom). Sources disagree on the meaning of a device's mode.
CELL_RULES = ("0", "(x+y)%2", "x%2", "y%2", "y%4", "(y+2(x%2))%4")
CELL_SIDE = 1 / math.sqrt(3)  # of a subpixel in a cell: a square, as calibrations do not tell its shape
MAX_CELLS = 4
MAX_OFFSET = 2.0  # pixels between a pixel's centre and its subpixels
MIN_SHEET_MM, MAX_SHEET_MM = 1e-3, 1e5
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
            return np.array({"rgb": channel - 1, "bgr": 1 - channel, "white": 0}[self.stripes] / 3), np.array(0.0)
        cell = cell_of(self.cell_rule, rows_from_bottom, columns)
        table = np.asarray(self.cells, float)
        return table[cell, 2 * channel], table[cell, 2 * channel + 1]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of a subpixel in pixels: the whole pixel, or a third of its area."""
        return (CELL_SIDE, CELL_SIDE) if self.cells else (1.0 if self.stripes == "white" else 1 / 3, 1.0)

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
            check_within("shift_mm", value, -MAX_SHEET_MM, MAX_SHEET_MM)

    def matrix(self, packing: str) -> Array:
        """(2, 2): its columns are the steps to the next point of a row and to the next row."""
        across, up = self.pitch_mm
        plain = np.array([[across, across / 2 if packing == "hexagonal" else 0.0], [0.0, up]])
        turn = math.radians(self.rotation_deg)
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        return np.asarray(rotation @ np.array([[1.0, self.shear], [0.0, 1.0]]) @ plain)

    def scaled(self, factor: float) -> Self:
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
TABLES = {"subpixels": Subpixels, "lenslet": Lenslet, "lenticular": Lenticular}


def cell_of(rule: str, rows_from_bottom: Array, columns: Array) -> Array:
    """Number of the cell of each pixel under one of CELL_RULES; shapes broadcast."""
    x, y = np.broadcast_arrays(columns, rows_from_bottom)
    cells: Array = {"0": 0 * x, "(x+y)%2": (x + y) % 2, "x%2": x % 2, "y%2": y % 2, "y%4": y % 4,
                    "(y+2(x%2))%4": (y + 2 * (x % 2)) % 4}[rule]
    return cells


def _check_length(field: str, value: float) -> None:
    if not MIN_SHEET_MM <= value <= MAX_SHEET_MM:
        fail(field, value, f"it must be a length from {MIN_SHEET_MM:g} to {MAX_SHEET_MM:g} millimetres")


@dataclasses.dataclass(frozen=True)
class DisplayProfile:
    """One light-field display; pairs are (horizontal, vertical)."""

    name: str  # what it is called on the command line
    panel_pixels: tuple[int, int]  # lenses × views, unless the panel has a lens sheet
    panel_mm: tuple[float, float]  # size of the panel
    # lenses, views: of the regular light field that is rendered; without a lens sheet those of the panel
    lenses: tuple[int, int]
    views: tuple[int, int]
    viewing_distance_mm: float  # from the lens array to the place where all views meet
    viewing_angle_deg: float  # width of the zone in which an eye sees the views of one lens
    # "flipped": an eye on the right sees the pixels left of a lens's centre (a physical lens array); "direct": the
    # display's driver flips them
    ei_order: str = "flipped"
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)  # scene-linear RGB in [0, 1], where a lens shows nothing
    title: str = dataclasses.field(default="", compare=False)  # what menus call it; empty for its name
    description: str = ""  # one line for menus
    # the panel's subpixels and its lens sheet, of one of the two kinds; None if the EIA is the panel's image
    subpixels: Subpixels | None = None
    lenslet: Lenslet | None = None
    lenticular: Lenticular | None = None
    weave: str = "views"  # one of WEAVES: what the weave interpolates
    # the quilt that other programs know of this model: tiles across and down, pixels of a tile across and down
    quilt: tuple[int, int, int, int] | None = dataclasses.field(default=None, compare=False)

    def __post_init__(self) -> None:
        for field, most in (("name", MAX_NAME), ("title", MAX_NAME), ("description", MAX_DESCRIPTION)):
            text = getattr(self, field)
            if len(text) > most or not text.isprintable() or (field == "name" and not text):
                fail(field, text, f"it must be one line of text of at most {most} characters"
                                  f"{', and not empty' if field == 'name' else ''}")
        check_choice("ei_order", self.ei_order, EI_ORDERS)
        check_choice("weave", self.weave, WEAVES)
        if not all(0 <= value <= 1 for value in self.background):
            fail("background", self.background, "it must be three scene-linear values from 0 to 1, [red, green, blue]")
        if not all(1 / MAX_MM <= length <= MAX_MM for length in self.panel_mm):
            fail("panel_mm", self.panel_mm, "it must be two lengths above 0 in millimetres, [width, height]")
        if not 1 / MAX_MM <= self.viewing_distance_mm <= MAX_MM:
            fail("viewing_distance_mm", self.viewing_distance_mm, "it must be a length above 0 in millimetres")
        check_within("viewing_angle_deg", self.viewing_angle_deg, 1, 120)
        if self.quilt and not (min(self.quilt) >= 1 and max(self.quilt[0] * self.quilt[2],
                                                           self.quilt[1] * self.quilt[3]) <= MAX_PIXELS):
            fail("quilt", self.quilt, "it must be tiles across and down and pixels of a tile across and down, at most "
                                      f"{MAX_PIXELS} pixels a side")
        for field in ("panel_pixels", "lenses", "views"):
            value = getattr(self, field)
            if not 1 <= min(value) <= max(value) <= MAX_PIXELS:
                fail(field, value, "it must be two whole numbers of at least 1; Blender renders no more than "
                                   f"{MAX_PIXELS} pixels a side")
        for axis, name in enumerate(("width", "height")):
            if (product := self.eia_pixels[axis]) > MAX_PIXELS:
                fail("views", list(self.views), f"lenses × views are {product} pixels of {name}, and Blender renders "
                                                f"no more than {MAX_PIXELS}")
            if not self.is_woven and self.panel_pixels[axis] != product:
                fail("panel_pixels", list(self.panel_pixels),
                     f"its {name} must be lenses × views = {self.lenses[axis]} × {self.views[axis]} = {product}")
        pitch_x, pitch_y = (mm / px for mm, px in zip(self.panel_mm, self.panel_pixels, strict=True))
        if all(self.parallax) and abs(pitch_x / pitch_y - 1) > 0.01:
            fail("panel_mm", list(self.panel_mm),
                 f"pixels must be square within 1 %, and these are {pitch_x:.4f} × {pitch_y:.4f} mm")
        if self.lenslet and self.lenticular:
            raise LfsrError("there are both a table lenslet and a table lenticular, but a panel has one sheet: "
                            "keep one")
        if not self.is_woven:
            if self.subpixels:
                raise LfsrError("there is a table subpixels but no lens sheet: add a table lenslet or lenticular")
            return
        if self.ei_order != "direct":
            fail("ei_order", self.ei_order, "with a lens sheet the weave orders the pixels: leave it out")
        if self.lenticular and self.views[1] != 1:
            fail("views", list(self.views), "a lenticular display has one view vertically: give [N, 1]")
        pixel, zone = self.panel_mm[0] / self.panel_pixels[0], self.camera_spacing_mm * self.views[0]
        widest = min(*self.panel_mm, zone / 2)
        for pitch in self.sheet.pitches:
            if not pixel <= pitch <= widest:
                fail("pitch_mm", pitch, f"it must be from a pixel, {pixel:.4g} mm, to the panel's shorter side and "
                                        f"half the width of the viewing zone, {widest:.4g} mm")

    @property
    def is_woven(self) -> bool:
        """Whether the panel has a lens sheet, so that its image is woven from the finished EIA."""
        return self.lenslet is not None or self.lenticular is not None

    @property
    def sheet(self) -> Sheet:
        """The lens sheet; LfsrError if the display has none."""
        sheet = self.lenslet or self.lenticular
        if sheet is None:
            raise LfsrError(f"display {self.name!r} has no lens sheet: give a profile of format 2 with a table "
                            "lenslet or lenticular")
        return sheet

    @property
    def pixel_layout(self) -> Subpixels:
        """Where the subpixels lie in a pixel; RGB stripes unless stated."""
        return self.subpixels or Subpixels()

    @property
    def flip(self) -> tuple[bool, bool]:
        """Whether the panel shows its image mirrored (left-right, up-down)."""
        return self.lenticular.flip if self.lenticular else (False, False)

    @property
    def lens_pitch_mm(self) -> tuple[float, float]:
        """Distance between neighbouring lens centres in millimetres."""
        return self.panel_mm[0] / self.lenses[0], self.panel_mm[1] / self.lenses[1]

    @property
    def camera_spacing_mm(self) -> float:
        """Distance between neighbouring view positions at the viewing distance.

        The views fill the viewing angle: px · CamDis = 2 · D · tan(angle / 2).
        """
        return 2 * self.viewing_distance_mm * math.tan(math.radians(self.viewing_angle_deg) / 2) / self.views[0]

    def depth_range_mm(self, scale: int = 1) -> tuple[float, float]:
        """Usable depth (in front of, behind) the display plane in millimetres.

        A point is usable if neighbouring views move it by at most one lens pitch on the display plane (display
        bandwidth; Zwicker et al. 2006). ``scale`` widens the view spacing to that of the low-resolution array.
        """
        distance = self.viewing_distance_mm
        pitch = min(self.lens_pitch_mm) if self.parallax[1] else self.lens_pitch_mm[0]
        spacing = self.camera_spacing_mm * scale
        behind = pitch * distance / (spacing - pitch) if spacing > pitch else math.inf
        return pitch * distance / (spacing + pitch), behind

    @property
    def parallax(self) -> tuple[bool, bool]:
        """Whether there are several views along each axis; a scale does not divide a single view."""
        return self.views[0] > 1, self.views[1] > 1

    @property
    def eia_pixels(self) -> tuple[int, int]:
        """Size of the finished EIA, lenses × views."""
        return self.lenses[0] * self.views[0], self.lenses[1] * self.views[1]

    def low_views(self, scale: int) -> tuple[int, int]:
        """Views per lens of the low-resolution EIA; LfsrError if ``scale`` does not divide the views."""
        if scale < 1 or any(count % scale for count in self._view_counts):
            *others, last = [1, *self.scales()]
            raise LfsrError(
                f"scale is {scale}, but display {self.name!r} has {self.views[0]}×{self.views[1]} views per "
                f"lens: choose a scale that divides {'both' if all(self.parallax) else 'them'}: "
                f"{', '.join(map(str, others))}{' or ' if others else ''}{last}")
        across, down = (count // scale if many else 1 for count, many in zip(self.views, self.parallax, strict=True))
        return across, down

    def finished_pixels(self, scale: int) -> int:
        """Pixels of the finished EIA for each rendered pixel."""
        return math.prod(scale for many in self.parallax if many)

    def scales(self) -> list[int]:
        """Scale factors from 2 to 10 that divide the views of every axis with several."""
        counts = self._view_counts
        return [scale for scale in range(2, 11) if counts and not any(count % scale for count in counts)]

    @property
    def _view_counts(self) -> list[int]:
        return [count for count in self.views if count > 1]

    def to_dict(self) -> dict[str, Any]:
        """The profile as JSON-ready data; ``from_dict`` reads it back."""
        data = {key: value for key, value in to_data(self).items() if value is not None}
        if not self.title:
            del data["title"]
        if self.is_woven:
            return data | {"format": 2}
        del data["weave"]
        return data

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source: str = "display profile") -> Self:
        """Return the profile of TOML or JSON data; LfsrError names the field, its value and the rule."""
        data = dict(data)
        number = data.pop("format", 1)
        if number not in (1, 2) or isinstance(number, bool):
            raise LfsrError(f"{source}: format is {repr(number)[:MAX_NAME]}, but this version reads 1 and 2")
        tables = [key for key in TABLES if data.get(key) is not None]
        if number == 1 and tables:
            raise LfsrError(f"{source}: a table {tables[0]} needs format = 2: add that line")
        if tables:
            data.setdefault("ei_order", "direct")
        if tables and ("lenses" not in data or "views" not in data):  # the light field is proposed
            kinds: dict[str, Any] = {"panel_pixels": Pair, "panel_mm": tuple[float, float], **TABLES}
            read: dict[str, Any] = {key: from_data(kinds[key], data.get(key), f"{source}: {key}")
                                    for key in ("panel_pixels", "panel_mm", *tables)}
            lenses, views = proposed_light_field(read["panel_pixels"], read["panel_mm"],
                                                 read.get("lenslet") or read.get("lenticular"))
            data = {"lenses": list(lenses), "views": list(views)} | data
        return from_data(cls, data, source)


def builtin_names() -> list[str]:
    """Names of the profiles that ship with the package, sorted."""
    return sorted(path.stem for path in PROFILE_FOLDER.glob("*.toml"))


def load_display(name_or_file: str | Path) -> DisplayProfile:
    """Return a built-in profile by its name, or the profile in a TOML file; LfsrError if there is neither."""
    if (path := Path(name_or_file)).suffix != ".toml":
        names = builtin_names()
        if str(name_or_file) not in names:
            raise LfsrError(f"unknown display {str(name_or_file)!r}: {did_you_mean(str(name_or_file), names)}"
                            "Give a .toml file, or a name that `lfsr displays` lists")
        path = PROFILE_FOLDER / f"{name_or_file}.toml"
    content = read_bytes(path, "a display profile", MAX_BYTES)
    try:
        data = tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise LfsrError(f"display profile {path} is not valid TOML ({without_advice(error)}): correct that "
                        "line") from None
    return DisplayProfile.from_dict(data, source=str(path.name))


def proposed_light_field(pixels: Pair, panel_mm: tuple[float, float], sheet: Sheet | None) -> tuple[Pair, Pair]:
    """Return lenses and views of a light field that loses nothing on a panel; LfsrError for no panel, or no sheet.

    Lenslets: one lens for every lens of the sheet and one view for every pixel behind it. Cylinders: one column for
    every cylinder, one row for two rows of pixels, and two views for every subpixel behind a cylinder, because
    neighbouring rows show views in between (docs/reference/displays.md). Views are rounded up to a multiple of 4.
    """
    if min(pixels) < 1 or max(pixels) > MAX_PIXELS or min(panel_mm) <= 0:
        raise LfsrError(f"panel_pixels is {pixels} and panel_mm is {panel_mm}, but both must be above 0 and pixels at "
                        f"most {MAX_PIXELS} a side")
    if sheet is None:
        raise LfsrError("there is no lens sheet to propose a light field for: give lenses and views")
    if isinstance(sheet, Lenticular):
        across = sheet.lenses_across(panel_mm[0])
        views = _up(VIEWS_PER_SUBPIXEL * 3 * pixels[0] / across, MULTIPLE)
        return (_up(across), _up(pixels[1] / VIEWS_PER_SUBPIXEL)), (views, 1)
    pixel, (pitch_x, pitch_y) = panel_mm[0] / pixels[0], sheet.lenses.pitch_mm
    lenses = _up(panel_mm[0] / pitch_x), _up(panel_mm[1] / pitch_y)
    # The cell of a lens in a hexagonal lattice is higher than the distance between rows.
    cell_y = pitch_y * (4 / 3 if sheet.packing == "hexagonal" else 1)
    return lenses, (_up(pitch_x / pixel, MULTIPLE), _up(cell_y / pixel, MULTIPLE))


def _up(value: float, multiple: int = 1) -> int:
    """Round ``value`` up to a multiple, ignoring an excess that is only a rounding error."""
    return max(1, math.ceil(value / multiple - 1e-6)) * multiple


def write_profile(path: str | Path, profile: DisplayProfile) -> None:
    """Write ``profile`` as TOML, completely or not at all; LfsrError if ``load_display`` would not read it back."""
    if (path := Path(path)).suffix != ".toml":
        raise LfsrError(f"{path} cannot be a display profile, because its name does not end in .toml: add the ending")
    with atomic_path(path) as temporary:
        data = profile.to_dict()
        temporary.write_text("\n".join(_lines({"format": data.pop("format", 1), **data}, "")) + "\n", encoding="utf-8")
        if load_display(temporary) != profile:
            raise LfsrError(f"display {profile.name!r} cannot be written so that it reads back the same: choose a "
                            "plainer name")


def _lines(data: dict[str, Any], table: str) -> list[str]:
    """Lines of TOML: the plain values of ``data``, then a table for each nested record."""
    plain = {key: value for key, value in data.items() if not isinstance(value, dict) and value is not None}
    # TOML writes numbers, truth values, lists and basic strings as JSON does.
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in plain.items()]
    for key, value in data.items():
        if isinstance(value, dict):
            lines += ["", f"[{table}{key}]", *_lines(value, f"{table}{key}.")]
    return lines
