"""The light field of a finished frame: its views and the places of their cameras."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import EIA_LINEAR_FILE, Frame, read_frame
from lfsr_core.frames.views import eia_to_views, read_views
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.display import DisplayProfile

LONGEST_NAME = 60  # characters


@dataclasses.dataclass(frozen=True)
class LightField:
    """All views of one finished frame."""

    views: Array  # (py, px, sy, sx, 3) display values, uint8; row 0 is the topmost camera, column 0 the leftmost
    frame: Frame  # camera geometry
    folder: Path  # the frame folder
    name: str  # for file names: letters, digits, "-" and "_"

    @property
    def display(self) -> DisplayProfile:
        """The display for which it was rendered."""
        return self.frame.display

    @property
    def count(self) -> tuple[int, int]:
        """Views (across, down)."""
        return self.views.shape[1], self.views.shape[0]

    @property
    def mm_per_unit(self) -> float:
        """Millimetres on the display per scene unit."""
        return self.display.panel_mm[0] / (2 * self.frame.array.half_width)

    def view_at(self, column: float, row: float) -> Array:
        """View (sy, sx, 3) uint8 at a place between cameras, interpolated linearly and clamped to the last camera."""
        return view_between(self.views, column, row)

    def seen_from(self, x_mm: float, y_mm: float = 0.0) -> Array:
        """View (sy, sx, 3) uint8 of an eye at the viewing distance, ``x_mm`` rightwards and ``y_mm`` upwards."""
        spacing, (across, down) = self.display.camera_spacing_mm, self.count
        return self.view_at((across - 1) / 2 + x_mm / spacing, (down - 1) / 2 - y_mm / spacing)

    def resampled(self, count: tuple[int, int] | None) -> Array:
        """Views (n_y, n_x, sy, sx, 3) of ``count`` (across, down) cameras over the same span; None: all views."""
        if count is None or count == self.count:
            return self.views
        columns, rows = (camera_places(n, wanted) for n, wanted in zip(self.count, count, strict=True))
        return np.stack([np.stack([self.view_at(x, y) for x in columns]) for y in rows])


def view_between(views: Array, column: float, row: float) -> Array:
    """View (sy, sx, 3) uint8 at a place between the cameras of ``views`` (py, px, sy, sx, 3)."""
    (left, right, x), (top, bottom, y) = _between(column, views.shape[1]), _between(row, views.shape[0])
    if not x and not y:
        return np.asarray(views[top, left])
    corners = (((1 - y) * (1 - x), top, left), ((1 - y) * x, top, right),
               (y * (1 - x), bottom, left), (y * x, bottom, right))
    mixed = sum(np.float32(weight) * views[j, i] for weight, j, i in corners if weight)
    return np.asarray(np.rint(mixed), np.uint8)


def camera_places(count: int, wanted: int) -> Array:
    """Places of ``wanted`` cameras, evenly spaced over the span of ``count`` cameras, as view numbers."""
    return np.asarray((np.arange(wanted) + 0.5) * count / wanted - 0.5)


def read_light_field(folder: str | Path) -> LightField:
    """Light field of a finished frame folder; LfsrError where its eia.png is missing or of another size."""
    folder, frame = Path(folder), read_frame(folder)
    return LightField(read_views(folder), frame, folder, _name(frame, folder))


def read_linear_views(field: LightField) -> Array:
    """Scene-linear views (py, px, sy, sx, 3) float32 from the folder's eia.exr; LfsrError where there is none."""
    path = field.folder / EIA_LINEAR_FILE
    if not path.is_file():
        raise LfsrError(f"{field.folder} has no {EIA_LINEAR_FILE}, which scene-linear views need: run `lfsr upscale` "
                        "on it with --linear-exr, or export PNG")
    return eia_to_views(read_layers(path)["color"][..., :3], field.display)


def _between(value: float, count: int) -> tuple[int, int, float]:
    """The two cameras around a place, and the fraction of the way from the first to the second."""
    value = min(max(float(value), 0.0), count - 1.0)
    nearest = round(value)
    if abs(value - nearest) < 1e-6:  # a camera's own place, but for rounding: its pixels stay as they are
        return nearest, nearest, 0.0
    return int(value), int(value) + 1, value - int(value)


def _name(frame: Frame, folder: Path) -> str:
    text = Path(frame.scene).stem or folder.resolve().name
    return re.sub(r"[^A-Za-z0-9-]+", "_", text)[:LONGEST_NAME].strip("_") or "lightfield"
