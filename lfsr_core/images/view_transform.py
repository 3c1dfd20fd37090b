"""From scene-linear light to display values, through Blender's own OpenColorIO configuration."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import PyOpenColorIO as ocio

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.images.baked_color import BRIGHTEST, bake
from lfsr_core.images.color_settings import ColorSettings

CONFIG_IN_BLENDER = "datafiles/colormanagement/config.ocio"
NO_LOOK = ("", "None")
MIN_GAMMA = 1e-3  # Blender allows 0
MIN_BAKED_PIXELS = 1 << 22  # from here on a table saves more time than it takes to make
FAST_VIEWS = ("Standard", "Raw", "Filmic", "Filmic Log")  # without a look as fast as a table


class ViewTransform:
    """Show scene-linear colour as Blender does under ``settings``, without dither.

    The order is Blender's: exposure, look, view and display, gamma. May be called
    from several threads at once. If there are enough ``pixels`` to show, bytes come from a table
    of the chain (baked_color.py): nearly all within 1 of 255 of Blender's, none beyond 3. A chain
    without such a table stays exact.
    LfsrError if the configuration is not found (the plain sRGB view needs none) or
    does not know a name.
    """

    def __init__(self, settings: ColorSettings, pixels: int = 0) -> None:
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
                processor = config.getProcessor(_display_chain(config, settings))
            except ocio.Exception as error:
                raise LfsrError(f"{path} cannot be used as a colour configuration ({str(error)[:100]}): "
                                "set OCIO to another") from None
        flags = ocio.OPTIMIZATION_DEFAULT
        self._baked: ocio.CPUProcessor | None = None
        self._to_float = processor.getOptimizedCPUProcessor(ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_F32, flags)
        self._to_bytes = processor.getOptimizedCPUProcessor(ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_UINT8, flags)
        if pixels >= MIN_BAKED_PIXELS and not (settings.look in NO_LOOK and settings.view_transform in FAST_VIEWS):
            self._baked = bake(self, self.to_uint8)

    @property
    def is_baked(self) -> bool:
        """Whether bytes come from a table of the chain."""
        return self._baked is not None

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
        (self._baked or self._to_bytes).apply(_image(source), _image(result))
        if self._baked and source.size and not (source.min() >= 0 and source.max() <= BRIGHTEST):
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
    in_wheel = [path for folder in folders for path in sorted(Path(folder).glob(f"*/{CONFIG_IN_BLENDER}"))]
    for path in named + in_wheel:
        if path.is_file():
            return path
    raise LfsrError(f"Blender's colour configuration is not at {settings.config or 'a known place'}: install the "
                    f"package bpy, or set OCIO to the {CONFIG_IN_BLENDER} inside Blender's folder")


def _display_chain(config: ocio.Config, settings: ColorSettings) -> ocio.GroupTransform:
    display, view = settings.display_device, settings.view_transform
    _check_known("display device", display, config.getDisplays())
    _check_known("view transform", view, config.getViews(display))
    chain, space = ocio.GroupTransform(), ocio.ROLE_SCENE_LINEAR
    factor = 2.0**settings.exposure
    chain.appendTransform(ocio.MatrixTransform(np.diag([factor, factor, factor, 1.0]).ravel().tolist()))
    if settings.look not in NO_LOOK:
        look, known = settings.look, list(config.getLookNames())
        with_view = f"{view} - {look}"  # Blender's interface omits the view's name
        if with_view in known and look not in known:
            look = with_view
        _check_known("look", look, known)
        behind_look = config.getLook(look).getProcessSpace()
        chain.appendTransform(ocio.LookTransform(src=space, dst=behind_look, looks=look))
        space = behind_look
    chain.appendTransform(ocio.DisplayViewTransform(src=space, display=display, view=view, looksBypass=True))
    if settings.gamma != 1:
        chain.appendTransform(ocio.ExponentTransform([1 / max(settings.gamma, MIN_GAMMA)] * 3 + [1.0]))
    return chain


def _check_known(what: str, name: str, known: Iterable[str]) -> None:
    names = list(known)
    if name not in names:
        hint = did_you_mean(name, names).rstrip("? ") or f"choose one of {', '.join(names)}"
        raise LfsrError(f"{what} {name!r} is not in Blender's colour configuration: {hint}")


def _image(pixels: Array) -> ocio.PackedImageDesc:
    width, channels = pixels.shape[-2:]
    height = pixels.size // (width * channels)
    depth = ocio.BIT_DEPTH_UINT8 if pixels.dtype == np.uint8 else ocio.BIT_DEPTH_F32
    size = pixels.itemsize
    return ocio.PackedImageDesc(pixels, width, height, channels, depth, size, size * channels,
                                size * channels * width)
