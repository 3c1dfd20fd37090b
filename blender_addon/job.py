"""One render job: the JSON file that the command line and the add-on hand to Blender."""

from __future__ import annotations

import dataclasses
import difflib
from pathlib import Path
from typing import Any

from lfsr_core.display import DisplayProfile
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json

KINDS = ("render", "reference")
LAYOUTS = ("one-pass", "view-by-view")


@dataclasses.dataclass(frozen=True)
class Job:
    """What to render and where to; fields as in docs/frame-folder.md.

    ``scene`` may be empty when Blender has it open already. ``frame`` None renders
    the scene's current frame, ``subject`` None everything but a collection called
    Background, ``world_visible`` None what the scene's own film setting says.
    """

    output: str
    display: DisplayProfile
    scene: str = ""
    kind: str = "render"
    scale: int = 4
    spp: int = 16
    layers: tuple[str, ...] = ()
    layout: str = "one-pass"
    convention: str = "centred"
    view_aperture: float = 1.0
    seed: int = 0
    frame: int | None = None
    subject: str | None = None
    lens_list: tuple[tuple[int, int], ...] | None = None
    device: str = "CPU"
    clamp_indirect: float | None = None
    world_visible: bool | None = None

    def __post_init__(self) -> None:
        _check_choice("kind", self.kind, KINDS)
        _check_choice("layout", self.layout, LAYOUTS)
        least = 2 if self.kind == "reference" else 1
        if type(self.spp) is not int or self.spp < least:
            raise LfsrError(f"samples per pixel is {self.spp!r}, but a {self.kind} needs a whole number "
                            f"of at least {least}")
        if type(self.scale) is not int:
            raise LfsrError(f"scale is {self.scale!r}, but it must be a whole number")
        self.display.low_views(self.scale)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Job:
        """Validated job from JSON data; LfsrError names an unknown or missing field."""
        known = {field.name for field in dataclasses.fields(cls)}
        for key in data:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1)
                raise LfsrError(f"job: unknown field {key!r}" + (f"; did you mean {close[0]!r}?" if close else ""))
        for key in ("output", "display"):
            if key not in data:
                raise LfsrError(f"job: field {key!r} is missing; every job needs it")
        return cls(**data | _typed(data))


def _typed(data: dict[str, Any]) -> dict[str, Any]:
    lenses = data.get("lens_list")
    return {"display": DisplayProfile.from_dict(data["display"]), "layers": tuple(data.get("layers", ())),
            "lens_list": None if lenses is None else tuple((int(row), int(column)) for row, column in lenses)}


def read_job(path: str | Path) -> Job:
    """Job from a JSON file; LfsrError if it is unreadable or wrong."""
    data = read_json(path, "a render job")
    if not isinstance(data, dict):
        raise LfsrError(f"{path} holds a {type(data).__name__}, but a render job must be a JSON object")
    return Job.from_dict(data)


def _check_choice(field: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise LfsrError(f"{field} is {value!r}, but it must be one of {', '.join(choices)}")
