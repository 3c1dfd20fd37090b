"""The light field of a finished frame, places of its cameras, and its views in other sizes and for other displays."""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import EIA_LINEAR_FILE, Frame, read_frame
from lfsr_core.frames.views import eia_to_views, read_views
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.methods.interpolation import cubic

LONGEST_NAME = 60  # characters
MOST_WIDTH = 16384
PIXELS_PER_LENS, USUAL_WIDTHS = 10, (320, 1920)
REACH = 2  # samples of the cubic kernel to either side


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
    name = re.sub(r"[^A-Za-z0-9-]+", "_", Path(frame.scene).stem or folder.resolve().name)
    return LightField(read_views(folder), frame, folder, name[:LONGEST_NAME].strip("_") or "lightfield")


def read_linear_views(field: LightField) -> Array:
    """Scene-linear views (py, px, sy, sx, 3) float32 from the folder's eia.exr; LfsrError where there is none."""
    path = field.folder / EIA_LINEAR_FILE
    if not path.is_file():
        raise LfsrError(f"{field.folder} has no {EIA_LINEAR_FILE}, which scene-linear views need: finish the "
                        "frame with a linear EXR, or export PNG")
    return eia_to_views(read_layers(path)["color"][..., :3], field.display)


def _between(value: float, count: int) -> tuple[int, int, float]:
    """The two cameras around a place, and the fraction of the way from the first to the second."""
    value = min(max(float(value), 0.0), count - 1.0)
    nearest = round(value)
    if abs(value - nearest) < 1e-6:  # a camera's own place, but for rounding: its pixels stay as they are
        return nearest, nearest, 0.0
    return int(value), int(value) + 1, value - int(value)


def on_screen(view: Array, display: DisplayProfile, width: int, part: tuple[float, float] = (1, 1)) -> Array:
    """Resample a view (sy, sx, 3) uint8 to (height, width, 3) in the panel's proportions, both even, as videos need.

    ``part``: factors by which the result is narrower and lower than these proportions. LfsrError for a width or height
    outside 16 to 16384 pixels.
    """
    return resized(view, screen_size(display, width, part))


def screen_size(display: DisplayProfile, width: int, part: tuple[float, float] = (1, 1)) -> tuple[int, int]:
    """(width, height) of what ``on_screen`` makes; LfsrError as there."""
    height = width * display.panel_mm[1] / display.panel_mm[0]
    if not 16 <= width <= MOST_WIDTH or not 2 <= height <= MOST_WIDTH:
        raise LfsrError(f"width is {width}, but images are 16 to {MOST_WIDTH} pixels wide and high: choose another")
    return int(width * part[0]) // 2 * 2, max(2, round(height * part[1] / 2) * 2)


def resized(view: Array, size: tuple[int, int], covers: tuple[float, float] = (1, 1)) -> Array:
    """Resample a view (sy, sx, 3) uint8 to ``size`` (width, height) pixels.

    ``covers``: fractions of the result's width and height that the view takes, in the middle; above 1 it is cut, below
    1 the rest is black.
    """
    if view.shape[1::-1] == size and covers == (1, 1):
        return view
    columns, rows = size
    tall = _weights(view.shape[0], rows, covers[1]) @ view.reshape(view.shape[0], -1).astype(np.float32)
    wide = np.matmul(_weights(view.shape[1], columns, covers[0]), tall.reshape(rows, view.shape[1], 3))
    return np.asarray(np.rint(np.clip(wide, 0, 255)), np.uint8)


def usual_width(display: DisplayProfile) -> int:
    """Default width: ten pixels per lens, within what screens show."""
    return min(max(PIXELS_PER_LENS * display.lenses[0], USUAL_WIDTHS[0]), USUAL_WIDTHS[1])


@functools.lru_cache(maxsize=8)
def _weights(size: int, target: int, covers: float = 1) -> Array:
    """Weights (target, size) float32 of cubic interpolation at pixel centres; downscaling widens the kernel."""
    stretch = max(1.0, size / target / covers)
    places = ((np.arange(target) + 0.5) / target - 0.5) / covers * size + size / 2 - 0.5
    reach = int(np.ceil(REACH * stretch))
    taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
    weights = cubic((places[:, None] - taps) / stretch)
    matrix = np.zeros((target, size), np.float32)
    np.add.at(matrix, (np.arange(target)[:, None], np.clip(taps, 0, size - 1)),
              weights / weights.sum(1, keepdims=True))
    matrix[(places < -0.5) | (places > size - 0.5)] = 0
    return matrix


@dataclasses.dataclass(frozen=True)
class Source:
    """Views of others."""

    views: Array  # (rows, columns, height, width, 3) uint8, row 0 the topmost cameras, column 0 the leftmost
    aspect: float  # width / height of the picture, whose pixels need not be square
    # whether neighbouring cameras differ by one angle, as in quilts; else by one distance
    equal_angles: bool


def retargeted(source: Source, display: DisplayProfile, angle_deg: float | None = None, fill: bool = False) -> Array:
    """Views (py, px, sy, sx, 3) uint8 for ``display``.

    Parameters
    ----------
    source : the views
    display : that they are shown on
    angle_deg : over which the cameras of ``source`` are spread horizontally; beyond it the outermost view repeats.
        None: the display's own angle
    fill : whether the picture fills the display and is cut; else all of it is seen, between black bars
    """
    wider = source.aspect / (display.panel_mm[0] / display.panel_mm[1])
    across = max(1.0, wider) if fill else min(1.0, wider)
    covers = (across, across / wider)
    views = np.stack([[resized(view, display.lenses, covers) for view in row] for row in source.views])
    angle, (down, count) = math.radians(angle_deg or display.viewing_angle_deg), source.views.shape[:2]
    right, up = ((np.arange(n) + 0.5 - n / 2) * display.camera_spacing_mm / display.viewing_distance_mm
                 for n in display.views)  # tangents of the display's cameras
    span = 2 * math.tan(angle / 2)
    columns = ((np.arctan(right) / angle if source.equal_angles else right / span) + 0.5) * count - 0.5
    rows = up / span * count + (down - 1) / 2  # as far apart as columns
    return np.stack([np.stack([view_between(views, column, row) for column in columns]) for row in rows])
