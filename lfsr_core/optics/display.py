"""Display profiles: the panel, its lens array and where the viewer stands.

A profile of format 1 has a whole number of pixels behind each lens: the finished EIA is the panel's image. One of
format 2 may say how a lens sheet really lies on the panel (``sheet.py``): then lenses and views are those of the
regular light field that is rendered, and the panel's image is woven from its EIA (``panel/weave.py``).
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.files import read_bytes
from lfsr_core.optics.proposal import PanelShape, proposed_light_field
from lfsr_core.optics.sheet import Lenslet, Lenticular, Subpixels
from lfsr_core.records import from_data

PROFILE_FOLDER = Path(__file__).parent / "displays"
EI_ORDERS = ("flipped", "direct")
MAX_PIXEL_ASPECT_ERROR = 0.01
MAX_PIXELS = 65536  # a side: no Blender renders more
LONGEST_MM = 1e9
MOST_NAME, MOST_DESCRIPTION = 100, 1000  # characters
MOST_BYTES = 100_000  # of a profile's file
FORMATS = (1, 2)
WEAVES = ("nearest", "views", "all")
RECORDS = {"subpixels": Subpixels, "lenslet": Lenslet, "lenticular": Lenticular}


@dataclasses.dataclass(frozen=True)
class DisplayProfile:
    """One light-field display; pairs are (horizontal, vertical)."""

    name: str  # what it is called on the command line
    panel_pixels: tuple[int, int]  # lenses × views, unless the panel's image is woven
    panel_mm: tuple[float, float]  # size of the panel
    # lenses, views: of the regular light field that is rendered, which without a lens sheet is the panel's own
    lenses: tuple[int, int]
    views: tuple[int, int]
    viewing_distance_mm: float  # from the lens array to where all views meet
    viewing_angle_deg: float  # width of the zone in which an eye sees the views of one lens
    # "flipped" where the pixel left of a lens centre is seen from the right (a physical lens array), "direct" where the
    # display driver flips
    ei_order: str = "flipped"
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)  # scene-linear RGB in [0, 1], where a lens shows nothing
    description: str = ""  # one line for menus
    # the real panel and its lens sheet, at most one of the two kinds; None where the EIA is the panel's image
    subpixels: Subpixels | None = None
    lenslet: Lenslet | None = None
    lenticular: Lenticular | None = None
    weave: str = "views"  # of WEAVES: what is interpolated where the panel's image is woven from the EIA

    def __post_init__(self) -> None:
        for check in (_check_counts, _check_lengths, _check_pixels, _check_look, _check_sheet):
            check(self)

    @property
    def is_woven(self) -> bool:
        """Whether the panel's image is another than the finished EIA: woven from it for the lens sheet."""
        return self.lenslet is not None or self.lenticular is not None

    @property
    def lens_pitch_mm(self) -> tuple[float, float]:
        """Distance between neighbouring lens centres in millimetres."""
        return self.panel_mm[0] / self.lenses[0], self.panel_mm[1] / self.lenses[1]

    @property
    def camera_spacing_mm(self) -> float:
        """Distance between neighbouring view positions at the viewing distance.

        The views fill the viewing angle: px · CamDis = 2 · D · tan(angle / 2).
        """
        span = 2 * self.viewing_distance_mm * math.tan(math.radians(self.viewing_angle_deg) / 2)
        return span / self.views[0]

    def depth_range_mm(self, scale: int = 1) -> tuple[float, float]:
        """Usable depth (in front of, behind) the display plane in millimetres.

        A point is usable while neighbouring views move it by at most one lens
        pitch on the display plane (display bandwidth; Zwicker et al. 2006).
        ``scale`` widens the view spacing to that of the low-resolution array.
        """
        distance = self.viewing_distance_mm
        pitch = min(self.lens_pitch_mm) if self.parallax[1] else self.lens_pitch_mm[0]
        spacing = self.camera_spacing_mm * scale
        behind = pitch * distance / (spacing - pitch) if spacing > pitch else math.inf
        return pitch * distance / (spacing + pitch), behind

    @property
    def parallax(self) -> tuple[bool, bool]:
        """Whether views differ along each axis; along one with a single view no scale divides it."""
        return self.views[0] > 1, self.views[1] > 1

    @property
    def eia_pixels(self) -> tuple[int, int]:
        """Size of the finished EIA, lenses × views."""
        return self.lenses[0] * self.views[0], self.lenses[1] * self.views[1]

    def low_views(self, scale: int) -> tuple[int, int]:
        """Views per lens of the low-resolution EIA; LfsrError if s does not divide those of an axis with several."""
        if scale < 1 or any(count % scale for count in self._divided):
            raise LfsrError(
                f"scale is {scale}, but display {self.name!r} has {self.views[0]}×{self.views[1]} views per "
                f"lens: choose a scale that divides {'both' if all(self.parallax) else 'them'}, one of {self.scales()}"
            )
        across, down = (count // scale if many else 1 for count, many in zip(self.views, self.parallax, strict=True))
        return across, down

    def scales(self) -> list[int]:
        """Scale factors above 1 that divide the view counts above 1, up to 10."""
        return [s for s in range(2, 11) if self._divided and not any(count % s for count in self._divided)]

    @property
    def _divided(self) -> list[int]:
        return [count for count in self.views if count > 1]

    def to_dict(self) -> dict[str, Any]:
        """The profile as JSON-ready data; ``from_dict`` reads it back."""
        data = {key: list(value) if isinstance(value, tuple) else value
                for key, value in dataclasses.asdict(self).items() if value is not None or key not in RECORDS}
        if self.is_woven:
            return data | {"format": 2}
        del data["weave"]
        return data

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source: str = "display profile") -> DisplayProfile:
        """Validated profile from TOML or JSON data; LfsrError names field, value and rule."""
        known = {field.name: field for field in dataclasses.fields(cls)}
        data = _of_format(data, source)
        for key in data:
            if key not in known:
                raise LfsrError(f"{source}: unknown field {key!r}; " + (
                    did_you_mean(key, known).rstrip() or f"the fields are {', '.join(known)}"))
        missing = [name for name, field in known.items()
                   if field.default is dataclasses.MISSING and name not in data]
        if missing:
            raise LfsrError(f"{source}: field {missing[0]!r} is missing; every profile needs it")
        values = {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}
        values |= {key: from_data(kind, data[key], f"{source}: {key}") for key, kind in RECORDS.items()
                   if data.get(key) is not None}
        try:
            return cls(**values)
        except LfsrError as error:
            raise LfsrError(f"{source}: {error}") from None


def _fail(field: str, value: Any, rule: str) -> None:
    raise LfsrError(f"{field} is {repr(value)[:MOST_NAME]}, but {rule}")


def _is_number(value: Any, least: float, most: float) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and least <= value <= most


def _is_length(value: Any) -> bool:
    return _is_number(value, 1 / LONGEST_MM, LONGEST_MM)


def _is_text(value: Any, most: int) -> bool:
    return isinstance(value, str) and len(value) <= most and value.isprintable()


def _check_counts(profile: DisplayProfile) -> None:
    if not profile.name or not _is_text(profile.name, MOST_NAME):
        _fail("name", profile.name, f"it must be a non-empty text of at most {MOST_NAME} characters")
    if not _is_text(profile.description, MOST_DESCRIPTION):
        _fail("description", profile.description, f"it must be a text of at most {MOST_DESCRIPTION} characters")
    for field in ("panel_pixels", "lenses", "views"):
        value = getattr(profile, field)
        whole = isinstance(value, tuple) and len(value) == 2 and all(type(n) is int and n >= 1 for n in value)
        if not whole:
            _fail(field, value, "it must be two whole numbers of at least 1, [horizontal, vertical]")
        if max(value) > MAX_PIXELS:
            _fail(field, value, f"Blender renders no more than {MAX_PIXELS} pixels a side")


def _check_lengths(profile: DisplayProfile) -> None:
    size = profile.panel_mm
    if not (isinstance(size, tuple) and len(size) == 2 and all(map(_is_length, size))):
        _fail("panel_mm", size, "it must be two lengths above 0 in millimetres, [width, height]")
    if not _is_length(profile.viewing_distance_mm):
        _fail("viewing_distance_mm", profile.viewing_distance_mm, "it must be a length above 0 in millimetres")
    if not _is_number(profile.viewing_angle_deg, 1, 120):
        _fail("viewing_angle_deg", profile.viewing_angle_deg, "it must be between 1 and 120 degrees")


def _check_pixels(profile: DisplayProfile) -> None:
    for axis, name in enumerate(("width", "height")):
        product = profile.eia_pixels[axis]
        if product > MAX_PIXELS:
            _fail("views", list(profile.views), f"lenses × views are {product} pixels of {name}, and Blender renders "
                                                f"no more than {MAX_PIXELS}")
        if not profile.is_woven and profile.panel_pixels[axis] != product:
            _fail("panel_pixels", list(profile.panel_pixels),
                  f"its {name} must be lenses × views = {profile.lenses[axis]} × {profile.views[axis]} = {product}")
    pitch_x, pitch_y = (mm / px for mm, px in zip(profile.panel_mm, profile.panel_pixels, strict=True))
    if abs(pitch_x / pitch_y - 1) > MAX_PIXEL_ASPECT_ERROR:
        _fail("panel_mm", list(profile.panel_mm),
              f"pixels must be square within 1 %, and these are {pitch_x:.4f} × {pitch_y:.4f} mm")


def _check_sheet(profile: DisplayProfile) -> None:
    for name, kind in RECORDS.items():
        if not isinstance(getattr(profile, name), (kind, type(None))):
            _fail(name, getattr(profile, name), "it must be a table")
    if profile.lenslet and profile.lenticular:
        raise LfsrError("there are both a table lenslet and a table lenticular, but a panel has one sheet: keep one")
    if profile.weave not in WEAVES:
        _fail("weave", profile.weave, f"it must be one of {', '.join(WEAVES)}")
    if not profile.is_woven:
        if profile.subpixels:
            raise LfsrError("there is a table subpixels but no lens sheet: add a table lenslet or lenticular")
        return
    if profile.ei_order != "direct":
        _fail("ei_order", profile.ei_order, "where a sheet is given the weave orders the pixels: leave it out")
    if profile.lenticular and profile.views[1] != 1:
        _fail("views", list(profile.views), "a lenticular display has one view vertically: give [N, 1]")
    pitch = min(profile.lenslet.lenses.pitch_mm) if profile.lenslet else profile.lenticular.pitch_mm
    most, pixel = min(profile.panel_mm), profile.panel_mm[0] / profile.panel_pixels[0]
    if not pixel <= pitch <= most:
        _fail("pitch_mm", pitch, f"it must be from a pixel, {pixel:.4g} mm, to the panel's shorter side, {most:.4g} mm")


def _of_format(data: Mapping[str, Any], source: str) -> dict[str, Any]:
    """A profile's fields without its format; of format 2 with the light field that it may leave out."""
    data = dict(data)
    number = data.pop("format", 1)
    if number not in FORMATS or isinstance(number, bool):
        raise LfsrError(f"{source}: format is {repr(number)[:MOST_NAME]}, but this version reads 1 and 2")
    sheets = [key for key in RECORDS if data.get(key) is not None]
    if number == 1 and sheets:
        raise LfsrError(f"{source}: a table {sheets[0]} needs format = 2: add that line")
    if not sheets:
        return data
    data.setdefault("ei_order", "direct")
    if "lenses" not in data or "views" not in data:
        shape = from_data(PanelShape, {key: data.get(key) for key in ("panel_pixels", "panel_mm")}, source)
        sheet = {key: from_data(RECORDS[key], data[key], f"{source}: {key}") for key in sheets}
        lenses, views = proposed_light_field(shape, sheet.get("lenslet"), sheet.get("lenticular"))
        data = {"lenses": list(lenses), "views": list(views)} | data
    return data


def _check_look(profile: DisplayProfile) -> None:
    if profile.ei_order not in EI_ORDERS:
        _fail("ei_order", profile.ei_order, f"it must be one of {', '.join(EI_ORDERS)}")
    color = profile.background
    if not (isinstance(color, tuple) and len(color) == 3 and all(_is_number(c, 0, 1) for c in color)):
        _fail("background", color, "it must be three scene-linear values from 0 to 1, [red, green, blue]")


def builtin_names() -> list[str]:
    """Names of the profiles that ship with the package, sorted."""
    return sorted(path.stem for path in PROFILE_FOLDER.glob("*.toml"))


def load_display(name_or_file: str | Path) -> DisplayProfile:
    """Built-in profile by name, or one from a TOML file; LfsrError if neither."""
    path = Path(name_or_file)
    if path.suffix != ".toml":
        names = builtin_names()
        if str(name_or_file) not in names:
            raise LfsrError(f"unknown display {str(name_or_file)!r}: {did_you_mean(str(name_or_file), names)}"
                            f"Give a .toml file or one of {', '.join(names)}")
        path = PROFILE_FOLDER / f"{name_or_file}.toml"
    return _read_profile(path)


def _read_profile(path: Path) -> DisplayProfile:
    content = read_bytes(path, "a display profile", MOST_BYTES)
    try:
        data = tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise LfsrError(f"display profile {path} is not valid TOML ({error}): correct that line") from None
    return DisplayProfile.from_dict(data, source=str(path.name))
