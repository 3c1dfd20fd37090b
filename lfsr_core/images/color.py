"""Colour: the sRGB curve, by which metrics compare images whatever their view transform, and Blender's view transform.

Blender's own OpenColorIO configuration converts scene-linear light to display values. Looks take up to ten times as
long as their view alone. A table, sampled on a grid that is even in log light, with tetrahedral interpolation, makes
all of Blender's views take equally long. OpenColorIO evaluates both; it is imported when an image is shown.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice, did_you_mean

if TYPE_CHECKING:
    import PyOpenColorIO as ocio

MAX_STOPS, MAX_GAMMA = 100, 100
CONFIG_IN_BLENDER = "datafiles/colormanagement/config.ocio"
NO_LOOK = ("", "None")
MIN_GAMMA = 1e-3  # Blender allows 0
MIN_BAKED_PIXELS = 1 << 22  # from here on a table saves more time than it takes to make
FAST_VIEWS = ("Standard", "Raw", "Filmic", "Filmic Log")  # without a look as fast as a table
# The table spans scene-linear light from 0 to BRIGHTEST, even in log2(light + 2^STOPS[0]).
STOPS, GRID = (-7.0, 3.0), 97
BRIGHTEST = 2.0**STOPS[1] - 2.0**STOPS[0]
# Accuracy that a table must have on TRIED random colours: the largest error in steps of 255, the largest fraction of
# colours with that error (so small that none is expected beyond), and the smallest fraction within one step.
MAX_STEPS, MAX_FRACTION, MIN_WITHIN_ONE, TRIED = 3, 1e-4, 0.999, 1 << 17
BLACK, WHITE = 8.5 / 255, 249.5 / 255  # display values
# Percentiles that are compared with these, so that a few sparks in the dark or specks on white do not count.
SPARKS, SPECKS = 99.5, 5.0


def srgb_encode(linear: Array) -> Array:
    """Encode linear values, clipped to [0, 1], by the sRGB curve (IEC 61966-2-1); any shape."""
    clipped = np.clip(linear, 0, 1)
    return np.where(clipped <= 0.0031308, clipped * 12.92, 1.055 * clipped ** (1 / 2.4) - 0.055).astype(clipped.dtype)


def srgb_decode(encoded: Array) -> Array:
    """Decode sRGB values in [0, 1] to linear light; any shape."""
    values = np.clip(encoded, 0, 1)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(values.dtype)


@dataclasses.dataclass(frozen=True)
class ColorSettings:
    """How Blender shows a scene: names from its OpenColorIO configuration."""

    display_device: str = "sRGB"  # the screen
    view_transform: str = "Standard"  # from scene-linear light to values of that screen
    look: str = "None"  # an artistic change before it; "None" or "" for none
    exposure: float = 0.0  # in stops
    gamma: float = 1.0  # exponent of the values is 1 / gamma
    config: str = dataclasses.field(default="", compare=False)  # its path on the machine that rendered, if still there

    def __post_init__(self) -> None:
        if not (abs(self.exposure) <= MAX_STOPS and 0 <= self.gamma <= MAX_GAMMA):
            raise LfsrError(f"exposure is {self.exposure!r} and gamma {self.gamma!r}, but they must be between "
                            f"-{MAX_STOPS} and {MAX_STOPS} stops, and 0 and {MAX_GAMMA}")


class ViewTransform:
    """Show scene-linear colour as Blender does under ``settings``, without dither.

    The order is Blender's: exposure, look, view and display, gamma. May be called from several threads at once. If
    there are enough ``pixels`` to show, bytes come from a table of the chain: nearly all within 1 of 255 of Blender's,
    none beyond 3. A chain without such a table stays exact. LfsrError if the configuration is not found (the plain sRGB
    view needs none) or does not know a name.
    """

    def __init__(self, settings: ColorSettings, pixels: int = 0) -> None:
        import PyOpenColorIO as ocio

        try:
            path: Path | None = find_config(settings)
        except LfsrError:
            if settings != ColorSettings():
                raise
            path = None  # imported light fields need no Blender
        if path is None:
            # Blender's Standard view on an sRGB display: IEC 61966-2-1, clipped to [0, 1].
            curve = ocio.ExponentWithLinearTransform(gamma=[2.4, 2.4, 2.4, 1], offset=[0.055, 0.055, 0.055, 0],
                                                     direction=ocio.TRANSFORM_DIR_INVERSE)
            clip = ocio.RangeTransform(minInValue=0, maxInValue=1, minOutValue=0, maxOutValue=1)
            processor = ocio.Config.CreateRaw().getProcessor(ocio.GroupTransform([clip, curve]))
        else:
            try:
                config = ocio.Config.CreateFromFile(str(path))
                display, view = settings.display_device, settings.view_transform
                _check_known("display device", display, config.getDisplays())
                _check_known("view transform", view, config.getViews(display))
                chain, space, factor = ocio.GroupTransform(), ocio.ROLE_SCENE_LINEAR, 2.0**settings.exposure
                chain.appendTransform(ocio.MatrixTransform(np.diag([factor, factor, factor, 1.0]).ravel().tolist()))
                if settings.look not in NO_LOOK:
                    look, names = settings.look, list(config.getLookNames())
                    with_view = f"{view} - {look}"  # Blender's interface omits the view's name
                    if with_view in names and look not in names:
                        look = with_view
                    _check_known("look", look, names)
                    behind_look = config.getLook(look).getProcessSpace()
                    chain.appendTransform(ocio.LookTransform(src=space, dst=behind_look, looks=look))
                    space = behind_look
                chain.appendTransform(ocio.DisplayViewTransform(src=space, display=display, view=view,
                                                                looksBypass=True))
                if settings.gamma != 1:
                    chain.appendTransform(ocio.ExponentTransform([1 / max(settings.gamma, MIN_GAMMA)] * 3 + [1.0]))
                processor = config.getProcessor(chain)
            except ocio.Exception as error:
                raise LfsrError(f"{path} cannot be used as a colour configuration ({str(error)[:100]}): "
                                "set OCIO to another") from None
        flags = ocio.OPTIMIZATION_DEFAULT
        self._to_float = processor.getOptimizedCPUProcessor(ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_F32, flags)
        self._to_bytes = processor.getOptimizedCPUProcessor(ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_UINT8, flags)
        self.table: ocio.CPUProcessor | None = None  # from which bytes come, in place of the chain
        if pixels < MIN_BAKED_PIXELS or (settings.look in NO_LOOK and settings.view_transform in FAST_VIEWS):
            return
        # The chain as a table from scene-linear floats to bytes.
        (low, high), width = STOPS, STOPS[1] - STOPS[0]
        shaper = ocio.LogAffineTransform(logSideSlope=[1 / width] * 3, logSideOffset=[-low / width] * 3,
                                         linSideSlope=[1.0] * 3, linSideOffset=[2.0**low] * 3)
        light = (2 ** np.linspace(low, high, GRID) - 2.0**low).astype(np.float32)
        colors = np.stack(np.meshgrid(light, light, light, indexing="ij"), -1)  # by red, green, blue
        with ThreadPoolExecutor(4) as pool:
            values = np.stack(list(pool.map(self, colors)))
        cube = ocio.Lut3DTransform(gridSize=GRID)
        cube.setInterpolation(ocio.INTERP_TETRAHEDRAL)
        cube.setData(values.ravel())
        processor = ocio.Config.CreateRaw().getProcessor(ocio.GroupTransform([shaper, cube]))
        table = processor.getOptimizedCPUProcessor(ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_UINT8, ocio.OPTIMIZATION_DEFAULT)
        colors = random_colors()
        exact, baked = self.to_uint8(colors), np.empty(colors.shape, np.uint8)
        table.apply(_image(colors), _image(baked))
        if is_accurate(np.abs(baked.astype(np.int16) - exact).max(-1)):
            self.table = table

    def __call__(self, linear: Array) -> Array:
        """Display values, float32 (..., W, 3), of scene-linear (..., W, 3); the display shows 0 to 1."""
        source = np.ascontiguousarray(linear, np.float32)
        result = np.empty_like(source)
        self._to_float.apply(_image(source), _image(result))
        return result

    def to_uint8(self, linear: Array) -> Array:
        """Display values, uint8 (..., W, 3), of scene-linear (..., W, 3), rounded as Blender rounds."""
        source = np.ascontiguousarray(linear, np.float32)
        result = np.empty(source.shape, np.uint8)
        (self.table or self._to_bytes).apply(_image(source), _image(result))
        if self.table and source.size and not (source.min() >= 0 and source.max() <= BRIGHTEST):
            # Pixels outside the table get the exact values.
            outside = ~((source >= 0) & (source <= BRIGHTEST)).all(-1)
            pixels = np.ascontiguousarray(source[outside][None])
            shown = np.empty(pixels.shape, np.uint8)
            self._to_bytes.apply(_image(pixels), _image(shown))
            result[outside] = shown[0]
        return result


def find_config(settings: ColorSettings) -> Path:
    """Path of Blender's OpenColorIO configuration: of the settings, of $OCIO, or in the bpy wheel (not imported)."""
    named = [Path(name) for name in (settings.config, os.environ.get("OCIO", "")) if name]
    spec = importlib.util.find_spec("bpy")
    folders = spec.submodule_search_locations or () if spec else ()
    for path in named + [path for folder in folders for path in sorted(Path(folder).glob(f"*/{CONFIG_IN_BLENDER}"))]:
        if path.is_file():
            return path
    raise LfsrError(f"Blender's colour configuration is not at {settings.config or 'a known place'}: install the "
                    f"package bpy, or set OCIO to the {CONFIG_IN_BLENDER} inside Blender's folder")


def _check_known(what: str, name: str, choices: Iterable[str]) -> None:
    names = list(choices)
    if name not in names:
        hint = did_you_mean(name, names).rstrip("? ") or f"choose one of {', '.join(names)}"
        raise LfsrError(f"{what} {name!r} is not in Blender's colour configuration: {hint}")


def _image(pixels: Array) -> ocio.PackedImageDesc:
    import PyOpenColorIO as ocio

    width, channels = pixels.shape[-2:]
    height = pixels.size // (width * channels)
    depth = ocio.BIT_DEPTH_UINT8 if pixels.dtype == np.uint8 else ocio.BIT_DEPTH_F32
    size = pixels.itemsize
    return ocio.PackedImageDesc(pixels, width, height, channels, depth, size, size * channels, size * channels * width)


def is_accurate(steps: Array) -> bool:
    """Whether a table with errors of ``steps`` of 255 can replace its chain."""
    few = np.mean(steps >= MAX_STEPS) <= MAX_FRACTION
    return bool(steps.max() <= MAX_STEPS and few and np.mean(steps <= 1) >= MIN_WITHIN_ONE)


def random_colors() -> Array:
    """(1, TRIED, 3) scene-linear colours of every lightness and saturation, always the same.

    Half of them lack one primary, because tables err most there.
    """
    random = np.random.default_rng(0)
    stops = random.uniform(STOPS[0] - 4, STOPS[1], (1, TRIED, 1)) + random.normal(0, 1.2, (1, TRIED, 3))
    colors, half = np.minimum(2**stops, BRIGHTEST).astype(np.float32), np.arange(0, TRIED, 2)
    colors[0, half, random.integers(0, 3, half.size)] = 0
    return colors


def exposure_notices(shown: Array, background: Array) -> list[Notice]:
    """Return a notice if the image is almost black or white; parameters as of ``extreme_tone``."""
    tone = extreme_tone(shown, background)
    return [Notice("image-extreme", {"tone": tone})] if tone else []


def extreme_tone(shown: Array, background: Array | None = None) -> str:
    """Return "black" or "white" if almost the whole image (..., 3), uint8 or floats in [0, 1], is; else "".

    Pixels of the colour ``background`` (3,) do not count, unless there are no others.
    """
    pixels = shown.reshape(-1, 3)
    if background is not None and (counted := (pixels != background).any(1)).any():
        pixels = pixels[counted]
    most = 255 if pixels.dtype == np.uint8 else 1
    if not len(pixels):
        return ""
    if np.percentile(pixels.max(1), SPARKS) <= BLACK * most:
        return "black"
    return "white" if np.percentile(pixels.min(1), SPECKS) >= WHITE * most else ""
