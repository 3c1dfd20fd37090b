"""The one contract that every upscaling method obeys, and the classical methods.

A method name is prefilters and one upscaler joined by "+", as ``oidn+bicubic``.
Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at
half-pixel centres.
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Mapping
from typing import Protocol

import cv2
import numpy as np

from lfsr_core import networks
from lfsr_core.denoise import denoise_low_resolution
from lfsr_core.errors import LfsrError


@dataclasses.dataclass(frozen=True)
class LowResEIA:
    """What a method sees of a low-resolution frame; (sy, sx, h, w, C) float32 arrays.

    ``color``: scene-linear RGB over the background, finite, >= 0. ``alpha``:
    coverage in [0, 1], C = 1. ``aux``: "albedo", "normal", "position" where
    rendered, C = 3. ``samples``: per pixel, the noise level. ``scale``: s.
    """

    color: np.ndarray
    alpha: np.ndarray
    aux: Mapping[str, np.ndarray]
    samples: int
    scale: int


class Upscaler(Protocol):
    """``low`` and lenses (N, 2) int (row, column) -> EIs (N, h·s, w·s, 3) float32.

    The result is scene-linear RGB >= 0 (float16 allowed). Whatever padding a
    method needs it makes itself. ``thread_safe``: may run on several lens rows at once.
    """

    name: str
    thread_safe: bool

    def __call__(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray: ...


@dataclasses.dataclass(frozen=True)
class Interpolation:
    """A classical upscaler: OpenCV's kernel ``flag`` that reaches ``reach`` low pixels.

    Samples beyond an EI repeat its border, or with ``crosstalk`` come from the
    neighbouring EIs as if the EIA were one photograph.
    """

    name: str
    flag: int
    reach: int
    crosstalk: bool = False
    thread_safe: bool = True

    def __call__(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray:
        padded = encode(_gather_padded(low.color, np.asarray(lenses), self.reach, self.crosstalk))
        count, rows, columns, _ = padded.shape
        # One tall image: the padding keeps the stacked EIs out of each other's reach.
        tall = cv2.resize(padded.reshape(count * rows, columns, 3), None, fx=low.scale, fy=low.scale,
                          interpolation=self.flag)
        margin = self.reach * low.scale
        inside = tall.reshape(count, rows * low.scale, columns * low.scale, 3)
        return decode(inside[:, margin:rows * low.scale - margin, margin:columns * low.scale - margin])


@dataclasses.dataclass(frozen=True)
class NoUpscaling:
    """Scale 1: the render is already at full resolution."""

    name: str = "none"
    thread_safe: bool = True

    def __call__(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray:
        if low.scale != 1:
            raise LfsrError(f"method {self.name!r} does not upscale, but the frame was rendered at scale {low.scale}: "
                            "choose an upscaling method, or render at scale 1")
        return low.color[lenses[:, 0], lenses[:, 1]]


CLASSICAL: dict[str, tuple[str, Upscaler]] = {
    "nearest": ("each view repeated", Interpolation("nearest", cv2.INTER_NEAREST, 0)),
    "bilinear": ("linear inside each elemental image", Interpolation("bilinear", cv2.INTER_LINEAR, 1)),
    "bicubic": ("cubic inside each elemental image", Interpolation("bicubic", cv2.INTER_CUBIC, 2)),
    "lanczos": ("8-tap Lanczos inside each elemental image", Interpolation("lanczos", cv2.INTER_LANCZOS4, 4)),
    "bicubic-eia": ("cubic over the whole array: shows crosstalk",
                    Interpolation("bicubic-eia", cv2.INTER_CUBIC, 2, crosstalk=True)),
    "none": ("no upscaling, for renders at scale 1", NoUpscaling()),
}
PREFILTERS: dict[str, tuple[str, Callable[[LowResEIA], LowResEIA]]] = {
    "oidn": ("Open Image Denoise on the whole array", denoise_low_resolution),
}
METHODS: dict[str, str] = {**{name: entry[0] for name, entry in (CLASSICAL | PREFILTERS).items()}, **networks.NAMES}
DEFAULT_METHOD = "oidn+bicubic"


@dataclasses.dataclass(frozen=True)
class Method:
    """Prefilters for the whole low-resolution EIA, in order, then one upscaler."""

    name: str
    prefilters: tuple[Callable[[LowResEIA], LowResEIA], ...]
    upscaler: Upscaler

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """The low-resolution EIA after every prefilter."""
        for prefilter in self.prefilters:
            low = prefilter(low)
        return low


def method(name: str) -> Method:
    """Method of a name such as "bicubic" or "oidn+bicubic"; "oidn" alone upscales nothing.

    LfsrError for an unknown part, with the nearest name, or a wrong order.
    """
    parts = [part.strip() for part in name.split("+")]
    for part in parts:
        _check_known(part)
    if parts[-1] in PREFILTERS:
        parts.append("none")
    for part in parts[:-1]:
        if part not in PREFILTERS:
            raise LfsrError(f"method {name!r} has upscaler {part!r} before its last part, but only "
                            f"{', '.join(PREFILTERS)} can stand there: put one upscaler last")
    return Method(name, tuple(PREFILTERS[part][1] for part in parts[:-1]), _load(parts[-1]))


def _check_known(part: str) -> None:
    if part not in METHODS:
        close = difflib.get_close_matches(part, METHODS, n=1, cutoff=0.4)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise LfsrError(f"unknown method {part!r}: {hint}Choose from {', '.join(METHODS)}, joined by '+'")


def _load(name: str) -> Upscaler:
    if name in CLASSICAL:
        return CLASSICAL[name][1]
    return networks.upscaler(name)


def encode(linear: np.ndarray) -> np.ndarray:
    """Scene-linear >= 0 to the domain of interpolation: √x up to 1, 1 + ½·ln x above.

    Near the eye's response, so that a highlight does not ring over dark
    neighbours, and cheap to undo on every pixel of an 8K image.
    """
    bright = np.log(np.maximum(linear, 1)) * np.float32(0.5)
    return np.sqrt(np.minimum(linear, 1)) + bright


def decode(encoded: np.ndarray) -> np.ndarray:
    """Inverse of ``encode``; negative overshoot becomes 0."""
    dark = np.clip(encoded, 0, 1)
    linear = np.multiply(dark, dark, out=dark)
    bright = encoded > 1
    if bright.any():
        linear[bright] = np.exp(2 * (encoded[bright] - 1))
    return linear


def _gather_padded(images: np.ndarray, lenses: np.ndarray, pad: int, crosstalk: bool) -> np.ndarray:
    """EIs of ``lenses`` with ``pad`` more pixels on every side, (N, h + 2 pad, w + 2 pad, C)."""
    sy, sx, height, width, _ = images.shape
    row, y = _padded_index(lenses[:, 0], height, sy, pad, crosstalk)
    column, x = _padded_index(lenses[:, 1], width, sx, pad, crosstalk)
    return images[row[:, :, None], column[:, None, :], y[:, :, None], x[:, None, :]]


def _padded_index(lens: np.ndarray, size: int, count: int, pad: int,
                  crosstalk: bool) -> tuple[np.ndarray, np.ndarray]:
    """Lens and pixel, each (N, size + 2 pad), of the padded pixels of each lens along one axis."""
    offset = np.arange(-pad, size + pad)
    if not crosstalk:
        offset = np.clip(offset, 0, size - 1)
    pixel = np.clip(lens[:, None] * size + offset, 0, count * size - 1)
    return pixel // size, pixel % size
