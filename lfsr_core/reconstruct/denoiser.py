"""The network that Open Image Denoise runs, and weights for elemental images.

A U-Net of 3×3 convolutions with bias: ReLU after all but the last, 2×2 max-pooling after enc_conv1 to 4, nearest
upsampling and a skip before dec_conv4a to 1a, zeros around the image up to a multiple of 16. Widths come from the
tensors.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json
from lfsr_core.reconstruct import tza

WEIGHTS = Path(__file__).parent / "weights" / "denoiser.tza"
INPUT = "input"
LAYERS = ("enc_conv0", "enc_conv1", "enc_conv2", "enc_conv3", "enc_conv4", "enc_conv5a", "enc_conv5b",
          "dec_conv4a", "dec_conv4b", "dec_conv3a", "dec_conv3b", "dec_conv2a", "dec_conv2b", "dec_conv1a",
          "dec_conv1b", "dec_conv0")
# What is concatenated with the upsampled layer before these.
SKIPS = {"dec_conv4a": "enc_conv3", "dec_conv3a": "enc_conv2", "dec_conv2a": "enc_conv1", "dec_conv1a": INPUT}
BASE = (32, 32, 48, 64, 80, 96, 96, 112, 112, 96, 96, 64, 64, 64, 32, 3)  # widths of the library's own networks,
SMALL = (32, 32, 32, 32, 32, 32, 32, 64, 64, 64, 64, 64, 32, 32, 32, 3)  # one channel count per layer
COLOR_INPUTS, GUIDED_INPUTS = 3, 9  # colour; colour, albedo and normal


@dataclasses.dataclass(frozen=True)
class Weights:
    """A checked file for the library."""

    content: bytes
    guided: bool  # whether the network sees albedo and normal too


def network_shapes(widths: Sequence[int], inputs: int = COLOR_INPUTS) -> dict[str, tuple[int, ...]]:
    """Shapes of all tensors, by name, of a network with ``widths`` channels after each of LAYERS."""
    channels = {INPUT: inputs, **dict(zip(LAYERS, widths, strict=True))}
    before = dict(zip(LAYERS, (INPUT, *LAYERS), strict=False))
    shapes: dict[str, tuple[int, ...]] = {}
    for layer in LAYERS:
        entering = channels[before[layer]] + (channels[SKIPS[layer]] if layer in SKIPS else 0)
        shapes |= {f"{layer}.weight": (channels[layer], entering, 3, 3), f"{layer}.bias": (channels[layer],)}
    return shapes


def check_network(tensors: Mapping[str, Array], origin: object, inputs: int = COLOR_INPUTS) -> tuple[int, ...]:
    """Widths of the network of ``tensors``; LfsrError unless they are all of it, with ``inputs`` channels."""
    found = {name: tensor.shape for name, tensor in tensors.items()}
    widths = [found.get(f"{layer}.bias", (0,))[0] for layer in LAYERS]
    widths[-1] = 3
    shapes = network_shapes(widths, inputs)
    for name in sorted(shapes.keys() | found.keys()):
        if found.get(name) != shapes.get(name):
            raise LfsrError(f"{origin} has tensor {name[:40]!r} of shape {found.get(name, 'missing')}, expected "
                            f"{shapes.get(name, 'no such tensor')}: choose weights of a denoiser with {inputs} inputs")
    return tuple(widths)


def load(path: str | Path = WEIGHTS) -> Weights:
    """Checked weights for colour, or for colour, albedo and normal; LfsrError where the file is missing or damaged.

    The library takes half floats alone, and other tensors are refused.
    """
    path = Path(path)
    return _load(path, path.stat().st_mtime_ns if path.exists() else 0)


@functools.lru_cache(maxsize=4)
def _load(path: Path, _written: int) -> Weights:
    content = tza.read_content(path)
    tensors = tza.parse(content, path)
    entering = tensors[f"{LAYERS[0]}.weight"].shape[1:2] if f"{LAYERS[0]}.weight" in tensors else ()
    inputs = GUIDED_INPUTS if entering == (GUIDED_INPUTS,) else COLOR_INPUTS
    check_network(tensors, path, inputs)
    facts = path.with_suffix(".json")
    known = digest = hashlib.sha256(content).hexdigest()
    with contextlib.suppress(LfsrError, LookupError, TypeError):  # a training writes them beside the weights
        known = read_json(facts, "the facts of a training")["sha256"]
    if digest != known:
        raise LfsrError(f"{path} does not have the SHA-256 in {facts.name}: it was changed or damaged, get both again")
    if any(tensor.dtype != np.float16 for tensor in tensors.values()):
        raise LfsrError(f"{path} holds single floats, but Open Image Denoise takes half floats: write them with "
                        "write_tza(half=True)")
    return Weights(content, inputs == GUIDED_INPUTS)
