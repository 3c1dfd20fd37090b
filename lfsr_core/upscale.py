"""The one contract that every upscaling method obeys, and the classical methods.

A method name is prefilters and one upscaler joined by "+", as ``oidn+bicubic``; "epi" after
them brings back detail that they lost, as in ``oidn+bicubic+epi``.
Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at
half-pixel centres.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from lfsr_core import denoise, epipolar, networks
from lfsr_core.denoise import GUIDES, denoise_both_ways, denoise_low_resolution
from lfsr_core.epipolar import Cleaner, Recovering
from lfsr_core.errors import LfsrError
from lfsr_core.kernels import kernel_matrix

EIS_IN_CACHE = 8  # per step of an interpolation: their result stays in a core's cache
MAX_EXPONENT = 80  # keeps overshoot beside the brightest floats finite
CROSSTALK_REACH = 4  # half the widest kernel


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
    method needs it makes itself. ``thread_safe``: may run on several lens rows at
    once. ``notes``: what the report should say about the run so far.
    """

    name: str
    thread_safe: bool
    notes: Sequence[str]

    def __call__(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray: ...


@dataclasses.dataclass(frozen=True)
class Interpolation:
    """A classical upscaler: ``kernel`` of kernels.KERNELS in both directions of each EI.

    Samples beyond an EI repeat its border, or with ``crosstalk`` come from the
    ``CROSSTALK_REACH`` nearest pixels of the neighbouring EIs, as if the EIA were
    one photograph.
    """

    name: str
    kernel: str
    crosstalk: bool = False
    thread_safe: bool = True
    notes: tuple[str, ...] = ()

    def __call__(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray:
        _, _, height, width, channels = low.color.shape
        lenses, margin = np.asarray(lenses), CROSSTALK_REACH if self.crosstalk else 0
        result = np.empty((len(lenses), height * low.scale, width * low.scale, channels), np.float32)
        for start in range(0, len(lenses), EIS_IN_CACHE):
            part = slice(start, start + EIS_IN_CACHE)
            interpolate(encode(_gather(low.color, lenses[part], margin)), self.kernel, low.scale, result[part], margin)
        return result

    def clean(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray:
        """What is interpolated: EIs of ``lenses``, (N, h, w, 3) in the domain of ``encode``."""
        return encode(low.color[lenses[:, 0], lenses[:, 1]])


def interpolate(encoded: np.ndarray, kernel: str, scale: int, out: np.ndarray, margin: int = 0) -> None:
    """Upscale encoded EIs (n, h + 2·margin, w + 2·margin, C) into scene-linear ``out`` (n, h·s, w·s, C)."""
    count, rows, columns, channels = encoded.shape
    down = kernel_matrix(kernel, rows - 2 * margin, scale, margin)
    across = _interleaved(kernel, columns - 2 * margin, scale, margin, channels)
    tall = (down @ encoded.reshape(count, rows, columns * channels)).reshape(-1, columns * channels)
    finished = out.reshape(len(tall), -1)
    decode(np.matmul(tall, across, out=finished), out=finished)


@functools.lru_cache(maxsize=16)
def _interleaved(kernel: str, columns: int, scale: int, margin: int, channels: int) -> np.ndarray:
    """Matrix that upscales rows of interleaved channels: the same weights for each, zero between them."""
    return np.kron(kernel_matrix(kernel, columns, scale, margin).T, np.eye(channels, dtype=np.float32))


@dataclasses.dataclass(frozen=True)
class NoUpscaling:
    """Scale 1: the render is already at full resolution."""

    name: str = "none"
    kernel: str = "nearest"
    thread_safe: bool = True
    notes: tuple[str, ...] = ()

    def __call__(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray:
        if low.scale != 1:
            raise LfsrError(f"method {self.name!r} does not upscale, but the frame was rendered at scale {low.scale}: "
                            "choose an upscaling method, or render at scale 1")
        return low.color[lenses[:, 0], lenses[:, 1]]

    def clean(self, low: LowResEIA, lenses: np.ndarray) -> np.ndarray:
        """EIs of ``lenses``, (N, h, w, 3) in the domain of ``encode``."""
        return encode(self(low, lenses))


CLASSICAL: dict[str, tuple[str, Upscaler]] = {
    "nearest": ("each view repeated", Interpolation("nearest", "nearest")),
    "bilinear": ("linear inside each elemental image", Interpolation("bilinear", "linear")),
    "bicubic": ("cubic inside each elemental image", Interpolation("bicubic", "cubic")),
    "lanczos": ("8-tap Lanczos inside each elemental image", Interpolation("lanczos", "lanczos")),
    "bicubic-eia": ("cubic over the whole array: shows crosstalk",
                    Interpolation("bicubic-eia", "cubic", crosstalk=True)),
    "none": ("no upscaling, for renders at scale 1", NoUpscaling()),
}
PREFILTERS: dict[str, tuple[str, Callable[[LowResEIA], LowResEIA]]] = {
    "oidn": ("Open Image Denoise on the whole array", denoise_low_resolution),
    "oidn-fast": ("the same in half the time, a little less accurate",
                  functools.partial(denoise_low_resolution, fast=True)),
    "oidn-guided": ("Open Image Denoise with albedo and normal, cleaned first: for plain surfaces",
                    functools.partial(denoise_low_resolution, guided=True)),
    "oidn-both": ("oidn and oidn-guided, for a network that mixes them", denoise_both_ways),
}
GUIDED = ("oidn-guided", "oidn-both")
DENOISERS = ("oidn", "oidn-fast", "oidn-guided")  # prefilters that make sense before an interpolation
RECOVERY = "epi"
UPSCALERS: dict[str, str] = {**{name: entry[0] for name, entry in CLASSICAL.items()}, **networks.NAMES}
METHODS: dict[str, str] = {**UPSCALERS, **{name: entry[0] for name, entry in PREFILTERS.items()},
                           RECOVERY: "last: detail that was taken for noise comes back along epipolar lines"}
PLAIN_METHOD = "bilinear"  # after OIDN more accurate than bicubic, see docs/measurements.md
# What our networks must beat.
PLAIN_CHAINS = (*(f"{name}+{PLAIN_METHOD}" for name in DENOISERS), f"{DENOISERS[0]}+{PLAIN_METHOD}+{RECOVERY}")
DEFAULT_METHOD = "oidn-both+refine+epi"  # see docs/networks.md


@dataclasses.dataclass(frozen=True)
class Method:
    """What is done to the whole low-resolution EIA, in order, then one upscaler."""

    name: str
    prefilters: tuple[Callable[[LowResEIA], LowResEIA], ...]
    upscaler: Upscaler

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """The low-resolution EIA after every prefilter."""
        for prefilter in self.prefilters:
            low = prefilter(low)
        return low


def method(name: str, weights: str | Path | None = None) -> Method:
    """Method of a name such as "bicubic" or "oidn+bicubic"; "oidn" alone upscales nothing.

    ``weights``: a file for its network instead of the shipped one. LfsrError for
    an unknown part, with the nearest name, a wrong order, or weights without a network.
    """
    parts = [part.strip() for part in name.split("+")]
    for part in parts:
        _check_known(part)
    recovers = len(parts) > 1 and parts[-1] == RECOVERY
    parts = parts[:-1] if recovers else parts
    if parts[-1] in PREFILTERS:
        parts.append("none")
    _check_order(name, parts)
    prefilters, upscaler = tuple(PREFILTERS[part][1] for part in parts[:-1]), _load(parts[-1], weights)
    if recovers:
        upscaler = Recovering(_cleaner(upscaler))
        prefilters += (upscaler.prepare,)
    return Method(name, prefilters, upscaler)


def layers_of(name: str) -> tuple[str, ...]:
    """Auxiliary layers that some part of method ``name`` looks at, sorted."""
    parts = name.split("+")
    asked = {layer for part in parts if part in networks.NETWORKS for layer in networks.NETWORKS[part].layers}
    return tuple(sorted(asked | (set(GUIDES) if set(GUIDED) & set(parts) else set())))


def versions_of(name: str) -> dict[str, int]:
    """Versions of what method ``name`` is made of, weights aside: figures measured with others are out of date."""
    parts = set(name.split("+"))
    return {**({"denoiser": denoise.VERSION} if parts & PREFILTERS.keys() else {}),
            **({RECOVERY: epipolar.VERSION} if RECOVERY in parts else {})}


def guide_notes(name: str, aux: Mapping[str, np.ndarray]) -> list[str]:
    """For the report: a sentence if method ``name`` would be guided by layers that ``aux`` lacks."""
    missing = [layer for layer in GUIDES if layer not in aux]
    if "oidn-guided" not in name.split("+") or not missing:
        return []
    return [f"oidn-guided is guided by the layers {', '.join(missing)}, which this frame lacks: it was denoised "
            "without them; render it again with --layers albedo,normal"]


def _check_order(name: str, parts: Sequence[str]) -> None:
    for part in parts[:-1]:
        if part not in PREFILTERS:
            raise LfsrError(f"method {name!r} has {part!r} before its last part, but only {', '.join(PREFILTERS)} can "
                            f"stand there: put one upscaler last, and {RECOVERY!r} after it")
    if parts[-1] == RECOVERY:
        raise LfsrError(f"method {name!r} has nothing before {RECOVERY!r}: use '{PLAIN_METHOD}+{RECOVERY}'")
    before = networks.NETWORKS[parts[-1]].after if parts[-1] in networks.NETWORKS else None
    if before and before not in parts:
        raise LfsrError(f"method {name!r} needs {before!r} before {parts[-1]!r}: use '{before}+{parts[-1]}'")


def _cleaner(upscaler: Upscaler) -> Cleaner:
    if not hasattr(upscaler, "clean") or getattr(upscaler, "crosstalk", False):
        raise LfsrError(f"{RECOVERY!r} cannot follow {upscaler.name!r}, which does more than interpolate each "
                        f"elemental image: leave {RECOVERY!r} out")
    return upscaler


def _check_known(part: str) -> None:
    if part not in METHODS:
        close = difflib.get_close_matches(part, METHODS, n=1, cutoff=0.4)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise LfsrError(f"unknown method {part!r}: {hint}Choose from {', '.join(METHODS)}, joined by '+'")


def _load(name: str, weights: str | Path | None) -> Upscaler:
    if name in networks.NETWORKS:
        return networks.upscaler(name, **({"weights": weights} if weights else {}))
    if weights:
        raise LfsrError(f"weights {weights} were given, but {name!r} is no network: choose one of "
                        f"{', '.join(networks.NETWORKS)} or leave them out")
    return CLASSICAL[name][1]


def encode(linear: np.ndarray) -> np.ndarray:
    """Scene-linear >= 0 to the domain of interpolation: √x up to 1, 1 + ½·ln x above.

    Near the eye's response, so that a highlight does not ring over dark
    neighbours, and cheap to undo on every pixel of an 8K image.
    """
    bright = np.log(np.maximum(linear, 1)) * np.float32(0.5)
    return np.sqrt(np.minimum(linear, 1)) + bright


def decode(encoded: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """Inverse of ``encode``, into ``out`` if given; negative overshoot becomes 0."""
    bright = encoded > 1 if encoded.size and encoded.max() > 1 else None
    # Highlights are few: only they pay for an exponential.
    highlights = np.exp(np.minimum(2 * (encoded[bright] - 1), MAX_EXPONENT)) if bright is not None else None
    linear = np.maximum(encoded, 0, out=out)
    np.multiply(linear, linear, out=linear)
    if bright is not None:
        linear[bright] = highlights
    return linear


def _gather(images: np.ndarray, lenses: np.ndarray, margin: int) -> np.ndarray:
    """EIs of ``lenses`` with ``margin`` pixels of their neighbours around, (N, h + 2·margin, w + 2·margin, C)."""
    if margin == 0:
        return images[lenses[:, 0], lenses[:, 1]]
    sy, sx, height, width, _ = images.shape
    rows = np.clip(lenses[:, :1] * height + np.arange(-margin, height + margin), 0, sy * height - 1)
    columns = np.clip(lenses[:, 1:] * width + np.arange(-margin, width + margin), 0, sx * width - 1)
    row, y, column, x = rows // height, rows % height, columns // width, columns % width
    return images[row[:, :, None], column[:, None, :], y[:, :, None], x[:, None, :]]
