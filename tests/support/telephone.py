"""A telephone's photograph of a panel, simulated ray by ray.

The rays are those of ``lfsr_core.optics.eye``, which shares no formula with the fit. A lens images a spot of
the panel and each subpixel in it lights its own channel, so that colour moiré appears as on a real display. Light is
linear until the camera encodes it; the sensor's distortion is another polynomial than the one that the fit solves for.
"""

import dataclasses
import io
import math

import cv2
import numpy as np
from PIL import Image

from lfsr_core.base.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eye import trace

# Bases of the generalised golden ratio in four dimensions: points that fill the unit cube evenly.
GOLDEN = np.array([0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101])
ORIENTATION = 0x0112  # EXIF's tag
STRATA = 3  # so that a focus of one pixel meets each of its subpixels once
ROWS_AT_ONCE = 64
PANEL_GAMMA = 2.2
EXPOSURE = 0.9  # of white


@dataclasses.dataclass(frozen=True)
class Shot:
    """How a photograph is taken."""

    eye_mm: tuple[float, float, float]
    size: tuple[int, int] = (1200, 900)  # pixels of the sensor
    fill: float = 0.8  # of the sensor's width, or its height if less remains, that the panel covers
    aim: tuple[float, float] = (0.0, 0.0)  # of the sensor's middle, in panel widths and heights
    roll_deg: float = 0.0
    orientation: int = 1  # the way the picture is stored, as EXIF counts it
    flagged: bool = True  # whether EXIF says so
    bend: tuple[float, float] = (0.0, 0.0)  # ideal radius = radius · (1 + a r² + b r⁴), 1 at the sensor's corner
    blur: float = 0.6  # standard deviation in pixels
    noise: float = 0.01  # of white; half of it is shot noise
    quality: int = 90  # of the JPEG
    rays: int = 2  # per pixel, across and down, each for STRATA parts of the focus


def jpeg(panel: Array, real: DisplayProfile, shot: Shot) -> bytes:
    """JPEG of ``panel`` (H, W, 3) uint8 seen through the sheet of ``real``."""
    picture, exif = Image.fromarray(np.rint(photograph(panel, real, shot) * 255).astype(np.uint8)), Image.Exif()
    if shot.flagged:
        exif[ORIENTATION] = shot.orientation
    file = io.BytesIO()
    stored(picture, shot.orientation).save(file, "jpeg", quality=shot.quality, exif=exif)
    return file.getvalue()


def stored(picture: Image.Image, orientation: int) -> Image.Image:
    """The upright ``picture`` as a file with EXIF's ``orientation`` holds it."""
    way = Image.Transpose
    # What undoes the turn or mirror that a reader applies.
    change = {2: way.FLIP_LEFT_RIGHT, 3: way.ROTATE_180, 4: way.FLIP_TOP_BOTTOM, 5: way.TRANSPOSE,
              6: way.ROTATE_90, 7: way.TRANSVERSE, 8: way.ROTATE_270}.get(orientation)
    return picture if change is None else picture.transpose(change)


def photograph(panel: Array, real: DisplayProfile, shot: Shot) -> Array:
    """(H, W, 3) from 0 to 1, upright, as the camera encodes it."""
    random, side = np.random.default_rng(0), 2 * max(1, math.ceil(3 * shot.blur)) + 1
    light = cv2.GaussianBlur(exposed(panel, real, shot, random), (side, side), shot.blur,
                             borderType=cv2.BORDER_REPLICATE)
    noise = random.normal(size=light.shape) * shot.noise * np.sqrt((0.5 + np.clip(light, 0, None)) / 1.5)
    seen = np.clip(light + noise, 0, 1)
    encoded: Array = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
    return encoded


def exposed(panel: Array, real: DisplayProfile, shot: Shot, random: np.random.Generator) -> Array:
    """(H, W, 3) linear light on the sensor, without blur and noise."""
    columns, rows = shot.size
    linear, light = (panel / 255) ** PANEL_GAMMA, np.empty((rows, columns, 3))
    focus, count = random.random((4, rows, columns)), shot.rays ** 2
    for start in range(0, rows, ROWS_AT_ONCE):
        part = slice(start, start + ROWS_AT_ONCE)
        light[part] = sum(_rays(linear, real, shot, (n % shot.rays, n // shot.rays), start, (
            (within[0] + np.arange(STRATA)[:, None, None]) / STRATA - 0.5, within[1] - 0.5, within[2], within[3]))
            for n in range(count) for within in [np.modf(focus[:, part] + n * GOLDEN[:, None, None])[0]])
    return light * EXPOSURE / count / STRATA


def _rays(linear: Array, real: DisplayProfile, shot: Shot, place: tuple[int, int], start: int,
          focus: tuple[Array, ...]) -> Array:
    """Light (rows, columns, 3) of one ray of each pixel of some rows, from the row ``start`` on, in all STRATA."""
    columns, rows = shot.size
    half = math.hypot(*shot.size) / 2
    # Within its part of the pixel a ray goes through another place in every pixel: no second lattice, no false moiré.
    right, down = ((number + within) / shot.rays for number, within in zip(place, focus[2:], strict=True))
    x = (np.arange(columns) + right - columns / 2) / half
    y = (rows / 2 - start - np.arange(len(focus[1]))[:, None] - down) / half
    square = x ** 2 + y ** 2
    straight = 1 + shot.bend[0] * square + shot.bend[1] * square ** 2
    aim, right, up, zoom = _axes(real, shot)
    ray = [aim[axis] + zoom * (x * straight * right[axis] + y * straight * up[axis]) for axis in range(3)]
    hit = [shot.eye_mm[axis] - ray[axis] * (shot.eye_mm[2] / ray[2]) for axis in (0, 1)]
    seen = trace(real, shot.eye_mm, *hit, (focus[0], focus[1]))
    if real.pixel_layout.count == 1:
        return np.asarray((linear[seen.row, seen.column] * seen.on_panel[..., None]).sum(0))
    brought = 3 * linear[seen.row, seen.column, seen.channel] * seen.on_panel
    return np.stack([np.where(seen.channel == channel, brought, 0).sum(0) for channel in range(3)], -1)


def _axes(real: DisplayProfile, shot: Shot) -> tuple[Array, Array, Array, float]:
    """Unit vectors of the camera, forwards, right and up, and tan of half its diagonal field."""
    (width, height), eye = real.panel_mm, np.array(shot.eye_mm)
    target = np.array([shot.aim[0] * width, shot.aim[1] * height, 0])
    aim = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(aim, np.array([-math.sin(math.radians(shot.roll_deg)), math.cos(math.radians(shot.roll_deg)), 0]))
    right /= np.linalg.norm(right)
    columns, rows = shot.size
    seen = max(width, height * columns / rows) / shot.fill  # of the panel's plane across the sensor
    zoom = seen / 2 / np.linalg.norm(target - eye) * math.hypot(columns, rows) / columns
    return aim, right, np.cross(right, aim), float(zoom)
