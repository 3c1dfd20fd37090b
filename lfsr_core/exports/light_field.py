"""The light field of a finished frame, its views in other sizes, and its disparity."""

from __future__ import annotations

import dataclasses
import functools
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import EIA_LINEAR_FILE, LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.low_res import low_resolution
from lfsr_core.frames.views import eia_to_views, read_views
from lfsr_core.images.exr import read_finite, read_layers
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


def central_disparity(field: LightField) -> Array | None:
    """Disparity (sy, sx) float32 at the centre of the cameras; None where the frame has no position layer.

    In pixels (lenses) per finished view, positive in front of the display plane: a camera one step to the right sees
    a point that many pixels further left, one step up that many further down. Empty pixels have that of infinity.
    """
    rendered = rendered_disparity(field)
    if rendered is None:
        return None
    seen, array, (sx, sy) = rendered.disparity, field.frame.array, field.display.lenses
    right, down = (place - (count - 1) / 2 for place, count in zip(rendered.place, field.count, strict=True))
    down = down * array.half_width / sx / (array.half_height / sy)  # in lenses across, which may not be square
    # One step of a fixed-point iteration, enough for the fractions of a pixel between the centre and the nearest view.
    rows, columns = np.indices(seen.shape)
    column = np.clip(np.rint(columns - right * seen), 0, seen.shape[1] - 1).astype(int)
    row = np.clip(np.rint(rows - down * seen), 0, seen.shape[0] - 1).astype(int)
    return np.asarray(seen[row, column])


class Rendered(NamedTuple):
    """Disparity of a rendered view."""

    disparity: Array  # (sy, sx) float32, as of ``central_disparity``
    place: tuple[float, float]  # of its camera, as numbers of finished views (column, row)


def rendered_disparity(field: LightField) -> Rendered | None:
    """Disparity of the rendered view nearest to the centre; None where the frame has no position layer."""
    path = field.folder / LOW_RES_FILE
    if "position" not in field.frame.layers or not path.is_file() or field.frame.lens_list is not None:
        return None
    layers, _ = read_finite(path)
    if "position" not in layers:
        return None
    low = low_resolution(layers, field.frame)
    row, column = low.color.shape[2] // 2, low.color.shape[3] // 2
    steps = (field.count[0] / low.color.shape[3], field.count[1] / low.color.shape[2])  # in finished views
    assert low.position is not None, "the layers have it"
    hit = low.alpha[:, :, row, column, 0] > 0
    to_array = np.linalg.inv(np.asarray(field.frame.matrix_world, float))
    distance = low.position[:, :, row, column] @ to_array[2, :3] + to_array[2, 3]  # from the camera plane
    depth, array = np.where(hit, distance, np.inf), field.frame.array
    nearness = array.distance / np.maximum(depth, 1e-6 * array.distance)
    return Rendered(np.asarray((1 - nearness) * infinite_disparity(field.frame), np.float32),
                    ((column + 0.5) * steps[0] - 0.5, (row + 0.5) * steps[1] - 0.5))


def infinite_disparity(frame: Frame) -> float:
    """Disparity at infinity, in pixels (lenses) per finished view."""
    pixel = 2 * frame.array.half_width / frame.display.lenses[0]
    return float(np.float32(-frame.array.spacing / pixel))
