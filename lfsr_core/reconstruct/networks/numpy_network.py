"""Our networks in NumPy, with the arithmetic of ``lfsr_lab.networks.lightfield.LightFieldNet``.

Every step is one matrix product over a few elemental images that stay in a core's cache. ONNX Runtime would add 15 to
24 MB to the extension per platform and Python.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.files import parse_json
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.encoding import decode, encode
from lfsr_core.reconstruct.networks import weights_file
from lfsr_core.records import from_data

MAX_LOG2_SAMPLES = 12.0
LEAST_LIGHT, MAX_GAIN = 1e-4, 2.0
# A firefly, measured on three scenes (docs/notebook/networks.md), exceeds this multiple of its brightest neighbour plus
# this multiple of a quantile of the EI's deviations,
FIREFLY, MOST_NOISE, NOISE_QUANTILE = 4.0, 5.0, 0.9
# and moves the mean by more than this fraction of it plus this value.
LEAST_FRACTION, LEAST_MOVE = 0.05, 0.002
MOST_BLOCKS = 64
ENCODED = ("oidn", "guided", "color")


def conserve(encoded: Array, light: Array) -> Array:
    """Scale encoded EIs (N, h, w, 3) to the mean scene-linear ``light`` (N, 1, 1, 3) of the render.

    The mean of a rendered EI is unbiased and has little noise; that of a network's result is biased.
    """
    linear = decode(encoded)
    gain = (light + LEAST_LIGHT) / (mean_light(linear) + LEAST_LIGHT)
    return encode(linear * np.clip(gain, 1 / MAX_GAIN, MAX_GAIN))


def steady_light(rendered: Array, encoded: Array) -> Array:
    """Mean scene-linear light (N, 1, 1, 3) of ``rendered`` EIs (N, h, w, 3), without their fireflies.

    A single path that meets a lamp by chance would brighten its whole EI. A value is taken for such a firefly, and
    replaced by the network's result (``encoded``), where it alone moves the mean and far exceeds both the result
    around it and the noise of the EI. Light that many pixels carry, such as leaves before a sky, stays.
    """
    clean = decode(encoded)
    excess, count = rendered - clean, rendered.shape[1] * rendered.shape[2]
    moves = excess > (LEAST_FRACTION * mean_light(clean) + LEAST_MOVE) * count
    light, some = mean_light(rendered), moves.any((1, 2, 3))
    if some.any():
        # Few EIs have such a value, so the slow quantile is taken of them alone.
        noise = np.quantile(np.abs(excess[some]), NOISE_QUANTILE, axis=(1, 2), keepdims=True)
        alone = excess[some] > FIREFLY * _brightest_around(clean[some]) + MOST_NOISE * noise
        light[some] = mean_light(np.where(alone & moves[some], clean[some], rendered[some]))
    return light


def _brightest_around(images: Array) -> Array:
    """Largest value among a pixel and its eight neighbours, (N, h, w, 3)."""
    (_, h, w, _), padded = images.shape, _bordered(images)
    around = (padded[:, row:row + h, column:column + w] for row, column in itertools.product(range(3), repeat=2))
    return functools.reduce(np.maximum, around)


def mean_light(images: Array) -> Array:
    """Mean (N, 1, 1, 3) of EIs (N, h, w, 3)."""
    return np.asarray(images.mean(1, keepdims=True).mean(2, keepdims=True))


def network_inputs(network: ElementalNetwork, low: LowResEIA, lenses: Array) -> tuple[Array, Array]:
    """Features (N, h, w, C) and base (N, h, w, 3) of ``lenses``, as in training."""
    layers = {"guided": low.color, **low.layers, "alpha": low.alpha, "oidn": low.color,
              "color": low.rendered if "oidn" in network.inputs else low.color}
    rows, columns = lenses[:, 0], lenses[:, 1]
    shape = (len(lenses), *low.color.shape[2:4])
    features = np.empty((*shape, network.input_channels), np.float32)
    start, base = 0, features[..., :3]
    for name in network.inputs:
        values = layers[name][rows, columns]
        if name in ENCODED:
            values = encode(values)
        elif name == "albedo":
            values = np.minimum(values, 1)  # Cycles adds emission to it
        end = start + values.shape[-1]
        features[..., start:end] = values
        if name == network.base:
            base = features[..., start:end]
        start = end
    features[..., start] = np.log2(low.samples) / MAX_LOG2_SAMPLES
    return features, base


@dataclasses.dataclass(frozen=True)
class Options:
    """Hyper-parameters of a network of ours, those of ``LightFieldNet``."""

    inputs: tuple[str, ...]  # layers in the features, in this order
    base: str  # layer to which the correction is added
    width: int  # channels at full resolution
    body_width: int  # channels at half resolution
    blocks: int  # of the body
    second_base: str = ""  # layer that is mixed with the base, or empty
    plain: float = 0.0  # fraction of the mean of both bases in the result
    spatial: bool = False  # blocks across lenses, for experiments in training alone

    def __post_init__(self) -> None:
        if not {self.base, self.second_base or self.base} <= {*self.inputs} or not 0 <= self.blocks <= MOST_BLOCKS:
            raise LfsrError(f"bases must be among the inputs, and blocks, {self.blocks}, at most {MOST_BLOCKS}")
        if not 0 <= self.plain <= 1:
            raise LfsrError(f"the fraction 'plain' is {self.plain}, expected 0 to 1")


class ElementalNetwork:
    """``LightFieldNet`` on channels-last arrays, made of its tensors and options; ``origin`` names them in errors."""

    def __init__(self, tensors: Mapping[str, Array], options: Mapping[str, Any], origin: object) -> None:
        if options.get("spatial"):
            raise LfsrError(f"{origin} holds a network with convolutions across lenses, which only training "
                            "supports: train it without them")
        known = from_data(Options, dict(options), "options")
        self.inputs, self.base, self._blocks, self._plain = known.inputs, known.base, known.blocks, known.plain
        self._second = channels(self.inputs[:self.inputs.index(known.second_base)]) if known.second_base else None
        _check(self, tensors, known, origin)
        # Convolutions (outputs, inputs, rows, columns) as (rows·columns·inputs, outputs) matrices.
        self._matrix = {name: np.ascontiguousarray(value.transpose(2, 3, 1, 0).reshape(-1, len(value)))
                        for name, value in tensors.items() if value.ndim == 4}
        self._bias = {name: value for name, value in tensors.items() if name.endswith("bias")}

    @property
    def input_channels(self) -> int:
        """Channels of the features, including the sample count."""
        return channels(self.inputs) + 1

    @property
    def layers(self) -> tuple[str, ...]:
        """Layers that a frame must have besides colour and alpha."""
        extra = tuple(name for name in self.inputs if name not in (*ENCODED, "alpha"))
        return (*extra, "noisy") if "oidn" in self.inputs else extra

    def __call__(self, features: Array, base: Array) -> Array:
        """Restored EIs (N, h, w, 3) of features (N, h, w, C) and base (N, h, w, 3), encoded."""
        h, w = features.shape[1:3]
        x = _even(_relu(self._conv(features, "stem")))
        d = _relu(self._dense(_fold(x), "down"))
        for block in range(self._blocks):
            for layer in ("angular", "spatial"):
                d += _relu(self._conv(d, f"body.{block}.{layer}"))
        x += _unfold(self._dense(d, "up"))
        correction = self._conv(_relu(x)[:, :h, :w], "out")
        keep = 1 - np.clip(correction[..., 3:4], 0, 1)
        if self._second is None:
            return np.asarray(base * keep + correction[..., :3])
        second = features[..., self._second:self._second + 3]
        mixed = (base + (second - base) * np.clip(correction[..., 4:], 0, 1)) * keep + correction[..., :3]
        return np.asarray(mixed + ((base + second) / 2 - mixed) * np.float32(self._plain))

    def _conv(self, x: Array, name: str) -> Array:
        return self._dense(_patches(x), name)

    def _dense(self, x: Array, name: str) -> Array:
        out: Array = x.reshape(-1, x.shape[-1]) @ self._matrix[f"{name}.weight"]
        out += self._bias[f"{name}.bias"]
        return out.reshape(*x.shape[:3], -1)


def load(path: Path) -> ElementalNetwork:
    """Network of a weights file; LfsrError where the file is missing, damaged or of another network."""
    return _load(path, path.stat().st_mtime_ns if path.exists() else 0)


@functools.lru_cache(maxsize=8)
def _load(path: Path, _written: int) -> ElementalNetwork:
    header, tensors = weights_file.read(path)
    if header.get("architecture") != "LightFieldNet":
        raise LfsrError(f"{path} holds weights for architecture {header.get('architecture')!r}, expected "
                        "'LightFieldNet': choose the file that fits or train it again")
    try:
        options = from_data(dict[str, Any], parse_json(header.get("options", "").encode()), "options")
        return ElementalNetwork(tensors, options, path)
    except ValueError as error:
        raise LfsrError(f"{path} holds no network ({error}): get it again or train it again") from None


def _check(network: ElementalNetwork, tensors: Mapping[str, Array], options: Options, origin: object) -> None:
    """LfsrError unless every tensor has the shape that follows from the options."""
    width, body = options.width, options.body_width
    outputs = 5 if options.second_base else 4  # correction, fraction of the base to drop, fraction of the second base
    shapes = {"stem": (width, network.input_channels, 3, 3), "down": (body, width, 2, 2), "up": (width * 4, body, 1, 1),
              "out": (outputs, width, 3, 3)}
    shapes |= {f"body.{block}.{layer}": (body, body, 3, 3)
               for block in range(options.blocks) for layer in ("angular", "spatial")}
    for name, shape in shapes.items():
        found = tensors.get(f"{name}.weight", np.empty(0)).shape
        if found != shape or tensors.get(f"{name}.bias", np.empty(0)).shape != shape[:1]:
            raise LfsrError(f"{origin} has tensor {name!r} of shape {found}, expected {shape}: "
                            "choose the file that fits or train it again")


def channels(layers: Sequence[str]) -> int:
    """Channels of input layers: one for alpha, three for every other."""
    return sum(1 if name == "alpha" else 3 for name in layers)


def _patches(x: Array) -> Array:
    """(N, h, w, C) -> (N, h, w, 9·C): 3×3 neighbours, the border repeated."""
    n, h, w, c = x.shape
    padded = _bordered(x)
    image, row, pixel, value = padded.strides
    # Three neighbours in a row are one run of memory.
    runs = np.lib.stride_tricks.as_strided(padded, (n, h, w, 3, 3 * c), (image, row, pixel, row, value))
    return runs.reshape(n, h, w, 9 * c)


def _bordered(x: Array) -> Array:
    """(N, h, w, C) -> (N, h + 2, w + 2, C), the border repeated; np.pad takes longer than the network itself."""
    n, h, w, c = x.shape
    padded = np.empty((n, h + 2, w + 2, c), x.dtype)
    padded[:, 1:-1, 1:-1] = x
    padded[:, 0, 1:-1], padded[:, -1, 1:-1] = x[:, 0], x[:, -1]
    padded[:, :, 0], padded[:, :, -1] = padded[:, :, 1], padded[:, :, -2]
    return padded


def _even(x: Array) -> Array:
    """Repeat the last row and column where their number is odd."""
    h, w = x.shape[1:3]
    return np.pad(x, ((0, 0), (0, h % 2), (0, w % 2), (0, 0)), mode="edge") if h % 2 or w % 2 else x


def _fold(x: Array) -> Array:
    """(N, 2h, 2w, C) -> (N, h, w, 4·C)."""
    n, h, w, c = x.shape
    return x.reshape(n, h // 2, 2, w // 2, 2, c).transpose(0, 1, 3, 2, 4, 5).reshape(n, h // 2, w // 2, 4 * c)


def _unfold(x: Array) -> Array:
    """Pixel shuffle: (N, h, w, 4·C), channel c·4 + 2·row + column -> (N, 2h, 2w, C)."""
    n, h, w, c = x.shape
    return x.reshape(n, h, w, c // 4, 2, 2).transpose(0, 1, 4, 2, 5, 3).reshape(n, 2 * h, 2 * w, c // 4)


def _relu(x: Array) -> Array:
    return np.asarray(np.maximum(x, 0, out=x))
