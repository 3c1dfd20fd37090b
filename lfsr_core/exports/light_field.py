"""The light field of a finished frame: its views as arrays, in other sizes and as images."""

import dataclasses
import functools
import re
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array, Bytes
from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, Frame, read_frame, read_rendered
from lfsr_core.images.image_files import read_png, write_png
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.rays import flip_order, from_elemental_images, from_views, to_views
from lfsr_core.reconstruct.upscaler import cubic

LONGEST_NAME = 60  # characters
MOST_WIDTH = 16384
PIXELS_PER_LENS, USUAL_WIDTHS = 10, (320, 1920)
REACH = 2  # samples of the cubic kernel to either side
VIEWS_ACROSS, GAP_PIXELS = 5, 4
SHEET_FILE, HORIZONTAL_EPI_FILE, VERTICAL_EPI_FILE, EYE_FILE = "views.png", "epi_x.png", "epi_y.png", "eye.png"
LEAST_EPI_HEIGHT, LEAST_VIEW_WIDTH = 160, 192


def read_views(folder: str | Path) -> Bytes:
    """Views (py, px, sy, sx, 3) uint8 of a finished frame folder: the display values of its eia.png.

    ``views[row, column]`` is the image that one camera sees; row 0 is the topmost camera, column 0 the leftmost.
    LfsrError where eia.png is missing or of another size than the display.
    """
    return np.ascontiguousarray(eia_to_views(read_png(Path(folder) / EIA_FILE), read_frame(folder).display))


def eia_to_views(panel: Array, display: DisplayProfile) -> Array:
    """EIA (H, W, C) in panel order, as in eia.png -> views (py, px, sy, sx, C); LfsrError if it has another size."""
    return to_views(view_order(panel, display), display.lenses)


def views_to_eia(views: Array, display: DisplayProfile) -> Array:
    """Views (py, px, sy, sx, C) -> EIA (H, W, C) in panel order, as in eia.png; LfsrError for another shape."""
    expected = (*display.views[::-1], *display.lenses[::-1])
    if views.ndim != 5 or views.shape[:4] != expected:
        raise LfsrError(f"views have shape {views.shape}, but display {display.name!r} needs {expected} and channels")
    image = from_views(views)
    return flip_order(image, display.lenses) if display.ei_order == "flipped" else image


def view_order(panel: Array, display: DisplayProfile) -> Array:
    """EIA (H, W, C) in panel order -> view order; LfsrError if it has another size than the display's EIA."""
    width, height = display.eia_pixels
    if panel.shape[:2] != (height, width):
        raise LfsrError(f"the EIA has {panel.shape[1]}×{panel.shape[0]} pixels, but display {display.name!r} has "
                        f"{width}×{height}: upscale the folder again")
    return flip_order(panel, display.lenses) if display.ei_order == "flipped" else panel


def contact_sheet(image: Array, lenses: tuple[int, int], across: int = VIEWS_ACROSS) -> Array:
    """Return a grid of evenly spaced views of an EIA (H, W, C) in view order; topmost, leftmost camera first.

    Views of few lenses are enlarged by repeating pixels.
    """
    views = to_views(image, lenses)
    # Each in the middle of an equal part of all views.
    rows, columns = (((np.arange(shown) + 0.5) * count / shown).astype(int)
                     for count in views.shape[:2] for shown in [min(count, across)])
    times = max(1, -(-LEAST_VIEW_WIDTH // views.shape[3]))
    shown = views[np.ix_(rows, columns)].repeat(times, axis=2).repeat(times, axis=3)
    padded = np.pad(shown, ((0, 0), (0, 0), (0, GAP_PIXELS), (0, GAP_PIXELS), (0, 0)), constant_values=255)
    return from_elemental_images(padded)[:-GAP_PIXELS, :-GAP_PIXELS]


def epi_pair(image: Array, lenses: tuple[int, int]) -> tuple[Array, Array]:
    """Return the horizontal and the vertical epipolar image through the middle, (views, lenses, C), enlarged.

    A slanted line is a point in depth, a vertical one lies on the display.
    """
    views = to_views(image, lenses)
    (py, px), (sx, sy) = views.shape[:2], lenses
    across, down = (epi.repeat(times, axis=0).repeat(times, axis=1)
                    for epi in (views[py // 2, :, sy // 2], views[:, px // 2, :, sx // 2])
                    for times in [max(1, -(-LEAST_EPI_HEIGHT // len(epi)))])
    return across, down


def write_views(folder: str | Path, eye_mm: tuple[float, float, float] | None = None) -> list[Path]:
    """Write the contact sheet and both EPIs of a finished folder, and return the files; LfsrError without an EIA.

    ``eye_mm``: also write what an eye sees from there, in millimetres right, up and towards the viewer from the
    display's centre. Of direct subpixel rendering this is the only image.
    """
    folder = Path(folder)
    if eye_mm is not None and (frame := read_rendered(folder)).subpixels:
        write_png(folder / EYE_FILE, eye_view(read_png(folder / PANEL_FILE), frame.display, eye_mm))
        return [folder / EYE_FILE]
    display, panel = read_frame(folder).display, read_png(folder / EIA_FILE)
    image = view_order(panel, display)
    images = dict(zip((HORIZONTAL_EPI_FILE, VERTICAL_EPI_FILE), epi_pair(image, display.lenses), strict=True))
    images[SHEET_FILE] = contact_sheet(image, display.lenses)
    if eye_mm is not None:
        images[EYE_FILE] = eye_view(read_png(folder / PANEL_FILE) if display.is_woven else panel, display, eye_mm)
    for name, pixels in images.items():
        write_png(folder / name, pixels)
    return [folder / name for name in images]


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
    return np.asarray(np.rint(sum(np.float32(weight) * views[j, i] for weight, j, i in corners if weight)), np.uint8)


def camera_places(count: int, wanted: int) -> Array:
    """Places of ``wanted`` cameras, evenly spaced over the span of ``count`` cameras, as view numbers."""
    return np.asarray((np.arange(wanted) + 0.5) * count / wanted - 0.5)


def read_light_field(folder: str | Path) -> LightField:
    """Light field of a finished frame folder; LfsrError where its eia.png is missing or of another size."""
    folder, frame = Path(folder), read_frame(folder)
    name = re.sub(r"[^A-Za-z0-9-]+", "_", Path(frame.scene).stem or folder.resolve().name)
    return LightField(read_views(folder), frame, folder, name[:LONGEST_NAME].strip("_") or "lightfield")


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
    np.add.at(matrix, (np.arange(target)[:, None], np.clip(taps, 0, size - 1)), weights / weights.sum(1, keepdims=True))
    matrix[(places < -0.5) | (places > size - 0.5)] = 0
    return matrix
