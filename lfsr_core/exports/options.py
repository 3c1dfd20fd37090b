"""Options of an export."""

from __future__ import annotations

import dataclasses

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Tell, silent

MOST_VIEWS = 1000  # a side
WIDEST_EYES_MM = 1000.0
MOST_SECONDS = 60.0
MOST_FPS = 240.0


@dataclasses.dataclass(frozen=True)
class ExportOptions:
    """Options of an export; None: the default of the format. LfsrError for values out of range."""

    views: tuple[int, int] | None = None  # cameras across and down, evenly spaced over the viewing zone
    grid: tuple[int, int] | None = None  # columns and rows of a quilt
    preset: str | None = None  # of a quilt, one of quilt_names.PRESETS
    eyes_mm: float | None = None  # distance between the eyes of a stereo pair or wiggle
    width: int | None = None  # in pixels, of an image or of a quilt's tile
    type: str | None = None  # file type, in formats that have several
    seconds: float | None = None  # duration of one sway or wiggle to and fro
    fps: float | None = None  # frames per second of a film
    tell: Tell = silent

    def __post_init__(self) -> None:
        for name in ("views", "grid"):
            pair = getattr(self, name)
            if pair is not None and not all(1 <= count <= MOST_VIEWS for count in pair):
                raise LfsrError(f"{name} is {pair[0]}x{pair[1]}, but both must be from 1 to {MOST_VIEWS}")
        for name, most in (("eyes_mm", WIDEST_EYES_MM), ("seconds", MOST_SECONDS), ("fps", MOST_FPS)):
            value = getattr(self, name)
            if value is not None and not 0 < value <= most:
                raise LfsrError(f"{name} is {value}, but it must be above 0 and at most {most:g}")

    def given(self) -> list[str]:
        """Names of the options that are not None."""
        return [name for name, value in vars(self).items() if name != "tell" and value is not None]


def chosen_type(options: ExportOptions, choices: tuple[str, ...]) -> str:
    """File type, by default the first of ``choices``; LfsrError for a type that is none of them."""
    if options.type is None:
        return choices[0]
    if options.type not in choices:
        raise LfsrError(f"type is {options.type!r}, but this format is written as {' or '.join(choices)}")
    return options.type
