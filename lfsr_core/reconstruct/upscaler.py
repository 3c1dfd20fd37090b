"""The low-resolution EIA of a frame as methods see it, opaque and by elemental images; the contract of an upscaler; and
the classical upscalers: interpolation inside each elemental image, by one matrix per axis, of encoded light.

Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at half-pixel centres. The kernels are those of
OpenCV's ``resize``, with which the tests compare.
"""

import abc
import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.base.system import in_threads
from lfsr_core.frames.frame import GUIDES, LOW_RES_FILE, WORLD_FILE, Frame
from lfsr_core.optics.rays import RayLayout, to_elemental_images, view_offset
from lfsr_core.optics.world_view import WorldImage, WorldView

ARRAYS = ("color", "alpha", "guides", "position", "slope", "noisy", "opacity", "places")
LEAST_ALPHA = 0.5  # coverage from which a pixel's position is that of a surface
# A path counts as longer than to the first hit from this ratio of lengths on, in pixels of at least this coverage.
LONGER, OPAQUE = 1.02, 0.99
FOREGROUND_INDEX, BACKGROUND_INDEX = 1, 2
MAX_EXPONENT = 80  # keeps overshoot beside the brightest floats finite
EIS_IN_CACHE = 8  # per step


@dataclasses.dataclass(frozen=True)
class LowResEIA:
    """Low-resolution EIA; (sy, sx, h, w, C) float32 arrays.

    Low view k' covers high views s·k' … s·k' + s - 1.
    """

    color: Array  # scene-linear RGB over the background, or before a ``world`` premultiplied; finite, >= 0
    alpha: Array  # coverage in [0, 1], C = 1
    samples: int  # per pixel, the noise level
    scale: int  # s, high-resolution views per low-resolution view along each axis with parallax
    guides: Array | None = None  # albedo in [0, 1] and normal in [-1, 1], C = 6, where rendered
    position: Array | None = None  # where rendered
    # Lenses that the point seen in a pixel moves by from one rendered view to the next, rightwards: the first that is
    # hit, and where paths were rendered (C = 2) the end of the path on which mirrors and clear glass send the ray. NaN
    # where nothing is hit. None where positions were not rendered.
    slope: Array | None = None
    slope_ratio: float = 1.0  # slope downwards / rightwards: the lens pitch across / down
    pixels: int = 0  # of the whole render, of which these lenses may be a part; 0 where not known
    block: int | None = None  # side of square blocks of lenses that are neighbours on the display, None where all are
    noisy: Array | None = None  # colour as rendered, where a denoiser has changed ``color``
    parallax: tuple[bool, bool] = (True, True)  # axes, (horizontal, vertical), along which the display's views differ
    exposure: float = 0.0  # of the view transform, in stops
    # device, gpus: on which the frame was rendered
    device: str = "CPU"
    gpus: tuple[str, ...] = ()
    notes: tuple[Notice, ...] = ()  # for the report, on what was done to it
    # For a world that is put behind the finished elemental images: how much of it is covered (C = 3, in [0, 1]), the
    # row and column of each lens on the display (sy, sx, 2), and what the lenses see of the world.
    opacity: Array | None = None
    places: Array | None = None
    world: WorldView | None = None
    cover: "LowResEIA | None" = None  # the opacity, prepared for an upscaler as the colour is

    @property
    def factors(self) -> tuple[int, int]:
        """High-resolution views per low-resolution view, (horizontal, vertical); 1 along an axis without parallax."""
        across, down = (self.scale if many else 1 for many in self.parallax)
        return across, down

    @property
    def finished_views(self) -> tuple[int, int]:
        """Views of a finished EI, (vertical, horizontal)."""
        return self.color.shape[2] * self.factors[1], self.color.shape[3] * self.factors[0]

    @property
    def rendered(self) -> Array:
        """Colour as rendered, before any denoiser."""
        return self.color if self.noisy is None else self.noisy

    def each(self, change: Callable[[Array], Array]) -> Self:
        """Return a copy with ``change`` applied to every array, for example to pick lenses."""
        changed: dict[str, Any] = {name: change(array) for name in ARRAYS if (array := getattr(self, name)) is not None}
        return dataclasses.replace(self, **changed)


def over_background(layers: Mapping[str, Array], frame: Frame, name: str = LOW_RES_FILE) -> Array:
    """Return the opaque scene-linear colour (H, W, 3) >= 0 of a render, over the visible world or the display's colour.

    Cycles has weighted the environment layer by what shows of it, so it is added as it is. A world in a file of its
    own is not added. LfsrError where the environment layer is missing, or where the file ``name`` that held the layers
    has another size than the frame.
    """
    color, (width, height) = layers["color"], (frame.subpixels or frame.rays).size
    if color.shape[:2] != (height, width):
        raise LfsrError(f"{name} has {color.shape[1]}×{color.shape[0]} pixels, but frame.json says {width}×{height}: "
                        "render the frame again")
    pixels: Array = color[..., :3]
    if frame.world_visible and "environment" not in layers:
        raise LfsrError("frame.json says that the world is visible, but the EXR has no environment layer: "
                        "render the frame again")
    if frame.world_visible and not frame.world_apart:
        pixels = pixels + layers["environment"]
    elif not frame.world_visible and any(frame.display.background):
        pixels = pixels + (1 - np.clip(color[..., 3:], 0, 1)) * np.asarray(frame.display.background, np.float32)
    return np.asarray(np.maximum(pixels, 0))


def low_resolution(layers: Mapping[str, Array], frame: Frame, world: WorldView | None = None) -> LowResEIA:
    """Return the low-resolution EIA in the layers of lr_eia.exr; LfsrError where their size is not the frame's.

    ``world``: the result of ``read_world`` for the same folder.
    """
    images = {"color": over_background(layers, frame), "alpha": np.clip(layers["color"][..., 3:], 0, 1)}
    if all(name in layers for name in GUIDES):
        albedo, normal = (layers[name] for name in GUIDES)
        if frame.world_apart:
            albedo = albedo - layers["environment"]  # Cycles adds what shows of the world
        images["guides"] = np.concatenate([np.clip(albedo, 0, 1), np.clip(normal, -1, 1)], -1)
    if "position" in layers:
        images["position"] = layers["position"]
    if "position" in layers and frame.convention == "centred":
        matrix, distance = np.asarray(frame.matrix_world), frame.array.distance
        images["slope"] = slopes = np.empty((*images["alpha"].shape[:2], 1 + ("path" in layers)), np.float32)
        right, up = (np.tile(view_offset(np.arange(count), count, sign * frame.rays.spacing), tiles)
                     for count, tiles, sign in zip(frame.rays.views, frame.rays.tiles, (1, -1), strict=True))

        def slopes_of(rows: slice) -> None:
            seen, alpha = (layers["position"][rows] - matrix[:3, 3]) @ matrix[:3, :3], images["alpha"][rows, :, 0]
            depth = np.where((alpha >= LEAST_ALPHA) & (seen[..., 2] > 0), seen[..., 2], np.nan)
            slopes[rows] = (1 - distance / depth[..., None]) * (frame.rays.spacing / _pitch(frame, 0))
            if "path" in layers:
                first = np.sqrt((seen[..., 0] - right)**2 + (seen[..., 1] - up[rows, None])**2 + depth**2)
                longer = layers["path"][rows, :, 0] / first + frame.array.clip_start / depth
                depth *= np.where((longer > LONGER) & (alpha > OPAQUE), longer, 1)
                slopes[rows, :, 1] = (1 - distance / depth) * (frame.rays.spacing / _pitch(frame, 0))

        in_threads(slopes_of, *slopes.shape[:2])
    if frame.world_apart:
        images["opacity"] = 1 - np.clip(layers["environment"], 0, 1)
    tiles: dict[str, Any] = {name: to_elemental_images(layer, frame.rays.tiles) for name, layer in images.items()}
    return LowResEIA(**tiles, samples=frame.samples, scale=frame.scale, parallax=frame.display.parallax, world=world,
                     exposure=frame.color.exposure, device=frame.device, gpus=frame.gpus,
                     places=frame.rays.shown_lenses if frame.world_apart else None,
                     slope_ratio=_pitch(frame, 0) / _pitch(frame, 1),
                     pixels=math.prod(frame.display.eia_pixels) // frame.display.finished_pixels(frame.scale))


def _pitch(frame: Frame, axis: int) -> float:
    """Distance of neighbouring lenses on the display plane, in scene units."""
    return 2 * frame.array.half_size[axis] / frame.display.lenses[axis]


def finished_layout(frame: Frame) -> RayLayout:
    """Return the rays of every view of the frame's display."""
    return RayLayout.for_display(frame.display, frame.array, convention=frame.convention,
                                 view_aperture=frame.view_aperture)


def read_world(folder: str | Path, frame: Frame) -> WorldView | None:
    """Read what the frame's display sees of the world; None where it is hidden or part of the render.

    LfsrError where its file is missing or of another size.
    """
    from lfsr_core.images.image_files import read_finite  # needs OpenImageIO, which Blender's panel does without

    if not frame.world_apart:
        return None
    path, layout = Path(folder) / WORLD_FILE, finished_layout(frame)
    pixels = read_finite(path)[0]["color"][..., :3]
    width, height = WorldImage.of(layout).size
    if pixels.shape[:2] != (height, width):
        raise LfsrError(f"{path} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but its frame.json asks for "
                        f"{width}×{height}: render the frame again")
    return WorldView.of(layout, pixels)


def foreground_mask(layers: Mapping[str, Array], lenses: tuple[int, int], dilate: int = 0) -> Mask:
    """Return a boolean (sy, sx): lenses with any hit of a foreground object.

    ``layers``: as of ``image_files.read_layers``; ``lenses``: (sx, sy); ``dilate``: lenses by which the mask grows in
    every direction, for parts so thin that they fall between sparse views.
    """
    mask: Mask = to_elemental_images(foreground_pixels(layers)[..., None], lenses).any(axis=(2, 3, 4))
    for _ in range(2 if dilate else 0):  # up and down, then sideways
        reach = min(dilate, len(mask))
        padded = np.pad(mask, ((reach, reach), (0, 0)))
        mask = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0).any(-1).T
    return mask


def foreground_pixels(layers: Mapping[str, Array]) -> Mask:
    """Return a boolean (H, W): pixels that a foreground object covers in part.

    Where background meshes are in sight, coverage does not decide. Cycles stores the index of a pixel's first sample
    only, so a covered pixel whose first sample passed everything may be either. It counts as foreground: a lens too
    many costs time, a lens too few costs quality.
    """
    covered: Mask = layers["color"][..., 3] > 0
    if (index := layers.get("index")) is None:
        return covered
    return np.asarray((index[..., 0] == FOREGROUND_INDEX) | (covered & (index[..., 0] != BACKGROUND_INDEX)))


def unseen_notices(layers: Mapping[str, Array]) -> list[Notice]:
    """Return a notice if a render shows none of the subject, with the fraction that background objects fill."""
    covered, index = layers["color"][..., 3] > 0, layers.get("index")
    # Without background meshes whatever covers a pixel is the subject. Pixels at the edges of such meshes are in doubt
    # everywhere, so they do not count here.
    if (covered if index is None else index == FOREGROUND_INDEX).any():
        return []
    return [Notice("subject-unseen", {"background": float(covered.mean())})]


def recall(mask: Mask, reference_mask: Mask) -> float:
    """Return the fraction of the reference's foreground lenses that are in ``mask``, 1 where it has none.

    Both are boolean (sy, sx); LfsrError where their shapes differ.
    """
    if mask.shape != reference_mask.shape:
        raise LfsrError(f"foreground masks have shapes {mask.shape} and {reference_mask.shape}: "
                        "compare frames of the same display")
    return float((mask & reference_mask).sum() / reference_mask.sum()) if reference_mask.any() else 1.0


class Upscaler(abc.ABC):
    """Makes finished elemental images of a low-resolution EIA; pads them itself where it needs to."""

    thread_safe: bool = False  # whether several threads may call it at once
    follows_depth: bool = False  # whether it reads the slopes of what is seen

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """Return what it is called with: ``low`` after all prefilters, and what all lenses have in common."""
        return low

    @abc.abstractmethod
    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs (N, h·s, w·s, 3), scene-linear RGB >= 0, of ``lenses`` (N, 2) as int (row, column)."""


def encode(linear: Array) -> Array:
    """Encode scene-linear values >= 0: √x up to 1, 1 + ½·ln x above.

    Interpolation of encoded highlights does not ring over dark neighbours, and decoding is fast on an 8K image.
    """
    encoded, bright = np.asarray(np.sqrt(np.minimum(linear, 1))), np.greater(linear, 1)
    if bright.any():
        # Highlights are few, so the logarithm is taken of them alone.
        encoded[bright] += np.log(linear[bright]) * np.float32(0.5)
    return encoded


def decode(encoded: Array, out: Array | None = None) -> Array:
    """Decode encoded values, into ``out`` if given; negative overshoot becomes 0."""
    bright = encoded > 1 if encoded.size and encoded.max() > 1 else None
    highlights = np.exp(np.minimum(2 * (encoded[bright] - 1), MAX_EXPONENT)) if bright is not None else None
    linear = np.maximum(encoded, 0, out=out)
    np.multiply(linear, linear, out=linear)
    if bright is not None:
        linear[bright] = highlights
    return linear


def linear(distance: Array) -> Array:
    """Tent, two samples wide."""
    return np.asarray(np.maximum(1 - np.abs(distance), 0))


def cubic(distance: Array) -> Array:
    """Keys' cubic convolution, four samples wide."""
    a, x = -0.75, np.abs(distance)  # OpenCV's and Blender's choice of Keys' a (1981)
    inner = ((a + 2) * x - (a + 3)) * x * x + 1
    return np.where(x <= 1, inner, np.where(x < 2, ((a * x - 5 * a) * x + 8 * a) * x - 4 * a, 0))


KERNELS: dict[str, tuple[int, Callable[[Array], Array]]] = {
    # A box, one sample wide; a tie goes to the sample on the right.
    "nearest": (1, lambda distance: ((distance > -0.5) & (distance <= 0.5)).astype(np.float64)),
    "linear": (1, linear), "cubic": (2, cubic),
    # Sharper than the tent, less noisy than the cubic.
    "halfway": (2, lambda distance: (linear(distance) + cubic(distance)) / 2)}
"""By name: samples to either side, and the weight at a distance in samples."""


@functools.lru_cache(maxsize=64)
def kernel_matrix(kernel: str, size: int, scale: float) -> Array:
    """Weights (size·scale, size) float32 that upscale a row of samples at half-pixel centres, the last one repeated."""
    reach, weight = KERNELS[kernel]
    count = round(size * scale)
    places = (np.arange(count) + 0.5) / scale - 0.5
    taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
    weights = weight(places[:, None] - taps)
    weights /= weights.sum(1, keepdims=True)
    matrix = np.zeros((count, size))
    np.add.at(matrix, (np.arange(count)[:, None], np.clip(taps, 0, size - 1)), weights)
    return matrix.astype(np.float32)


def interpolated(images: Array, kernel: str, factors: tuple[int, int], out: Array | None = None) -> Array:
    """Upscale ``images`` (N, h, w, C) by ``factors`` (horizontal, vertical), into ``out`` if given, contiguous."""
    count, rows, columns, channels = images.shape
    down = kernel_matrix(kernel, rows, factors[1])
    across = np.kron(kernel_matrix(kernel, columns, factors[0]).T, np.eye(channels, dtype=np.float32))  # (w·C, W·C)
    tall = (down @ images.reshape(count, rows, columns * channels)).reshape(-1, columns * channels)
    wide = np.matmul(tall, across, out=None if out is None else out.reshape(len(tall), -1))
    return np.asarray(wide).reshape(count, len(down), across.shape[1] // channels, channels)


@dataclasses.dataclass(frozen=True)
class Interpolation(Upscaler):
    """One kernel in both directions of each EI; at scale 1 the EIs as they are."""

    kernel: str  # of KERNELS
    thread_safe: bool = True

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        lenses = np.asarray(lenses)
        if low.scale == 1:
            return np.asarray(low.color[lenses[:, 0], lenses[:, 1]])
        result = np.empty((len(lenses), *low.finished_views, low.color.shape[-1]), np.float32)
        for start in range(0, len(lenses), EIS_IN_CACHE):
            part = slice(start, start + EIS_IN_CACHE)
            seen = encode(low.color[lenses[part, 0], lenses[part, 1]])
            decode(interpolated(seen, self.kernel, low.factors, result[part]), out=result[part])
        return result
