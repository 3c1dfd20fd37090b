"""What a person chooses about an export, besides its format."""

from __future__ import annotations

import dataclasses

from lfsr_core.errors import LfsrError
from lfsr_core.progress import Progress, silent

MOST_VIEWS = 1000  # a side
WIDEST_EYES_MM = 1000.0
MOST_SECONDS = 60.0
MOST_FPS = 240.0


@dataclasses.dataclass(frozen=True)
class ExportOptions:
    """None is the format's own choice; LfsrError on values that cannot be."""

    views: tuple[int, int] | None = None  # cameras across and down, evenly over the viewing zone
    grid: tuple[int, int] | None = None  # tiles across and down a quilt
    eyes_mm: float | None = None  # between the eyes of a stereo pair
    width: int | None = None  # pixels of a picture, or of a quilt's tile
    type: str | None = None  # of the file, where a format has several
    seconds: float | None = None  # of one sway to and fro
    fps: float | None = None  # frames a second of a film
    progress: Progress = silent  # called with (stage, fraction, message)

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
        """Names of the options that were chosen."""
        return [field.name for field in dataclasses.fields(self)
                if field.name != "progress" and getattr(self, field.name) is not None]


def kind(options: ExportOptions, choices: tuple[str, ...]) -> str:
    """The type of file, by default the first of ``choices``; LfsrError for another."""
    if options.type is None:
        return choices[0]
    if options.type not in choices:
        raise LfsrError(f"type is {options.type!r}, but this format is written as {' or '.join(choices)}")
    return options.type
