"""A finished frame as what every export starts from: its views, and where their cameras are."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import EIA_LINEAR_FILE, Frame, read_frame
from lfsr_core.frames.views import eia_to_views, read_views
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.display import DisplayProfile

LONGEST_NAME = 60  # characters


@dataclasses.dataclass(frozen=True)
class LightField:
    """All views of one finished frame."""

    views: Array  # (py, px, sy, sx, 3) display values, uint8; row 0 is the topmost camera, column 0 the leftmost
    frame: Frame  # where the cameras stood
    folder: Path  # the frame folder
    name: str  # for file names: letters, digits, "-" and "_"

    @property
    def display(self) -> DisplayProfile:
        """The display it was made for."""
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
        """View (sy, sx, 3) uint8 between cameras, linear between the four nearest; beyond the last it is the last."""
        (low_x, high_x, x), (low_y, high_y, y) = (_between(value, n) for value, n in zip((column, row), self.count,
                                                                                        strict=True))
        if not x and not y:
            return self.views[low_y, low_x]
        corners = (((1 - y) * (1 - x), low_y, low_x), ((1 - y) * x, low_y, high_x),
                   (y * (1 - x), high_y, low_x), (y * x, high_y, high_x))
        mixed = sum(np.float32(weight) * self.views[j, i] for weight, j, i in corners if weight)
        return np.rint(mixed).astype(np.uint8)

    def seen_from(self, x_mm: float, y_mm: float = 0.0) -> Array:
        """View (sy, sx, 3) uint8 of an eye at the viewing distance, ``x_mm`` to the right and ``y_mm`` up."""
        spacing, (across, down) = self.display.camera_spacing_mm, self.count
        return self.view_at((across - 1) / 2 + x_mm / spacing, (down - 1) / 2 - y_mm / spacing)

    def resampled(self, count: tuple[int, int] | None) -> Array:
        """(n_y, n_x, sy, sx, 3) views of ``count`` (across, down) cameras that share the same span; None for all."""
        if count in (None, self.count):
            return self.views
        columns, rows = (camera_places(n, wanted) for n, wanted in zip(self.count, count, strict=True))
        return np.stack([np.stack([self.view_at(x, y) for x in columns]) for y in rows])


def camera_places(count: int, wanted: int) -> Array:
    """Places of ``wanted`` cameras among ``count``, as view numbers: each the middle of an equal share."""
    return (np.arange(wanted) + 0.5) * count / wanted - 0.5


def read_light_field(folder: str | Path) -> LightField:
    """The views of a finished frame folder; LfsrError where its eia.png is missing or of another size."""
    folder, frame = Path(folder), read_frame(folder)
    return LightField(read_views(folder), frame, folder, _name(frame, folder))


def read_linear_views(field: LightField) -> Array:
    """Scene-linear (py, px, sy, sx, 3) float32 of the folder's eia.exr; LfsrError where there is none."""
    path = field.folder / EIA_LINEAR_FILE
    if not path.is_file():
        raise LfsrError(f"{field.folder} has no {EIA_LINEAR_FILE}, which scene-linear views are made of: run "
                        "`lfsr upscale` on it with --linear-exr, or export PNG")
    return eia_to_views(read_layers(path)["color"][..., :3], field.display)


def _between(value: float, count: int) -> tuple[int, int, float]:
    """The two cameras around a place, and how far it is from the first to the second."""
    value = min(max(float(value), 0.0), count - 1.0)
    low = min(int(value), count - 1)
    # Places that are a camera's but for rounding are that camera's, so that its pixels stay as they are.
    nearest = round(value)
    if abs(value - nearest) < 1e-6:
        return nearest, nearest, 0.0
    return low, low + 1, value - low


def _name(frame: Frame, folder: Path) -> str:
    text = Path(frame.scene).stem or folder.resolve().name
    return re.sub(r"[^A-Za-z0-9-]+", "_", text)[:LONGEST_NAME].strip("_") or "lightfield"
