"""PyTorch twin of the network that Open Image Denoise runs, for training weights of ours.

Its tensors have the names and the layout of a TZA file (``lfsr_core.reconstruct.methods.denoise``).
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.reconstruct.methods import denoise
from lfsr_core.reconstruct.methods.denoise import COLOR_INPUTS, LAYERS, SKIPS, check_network, network_shapes
from lfsr_lab.networks.tza import SMALL

MULTIPLE = 16  # of the sides of what the network sees
POOLED = ("enc_conv1", "enc_conv2", "enc_conv3", "enc_conv4")  # 2×2 max-pooling after these
# The library's transfer function for HDR, perceptually uniform: a line, a power, a logarithm.
PU_LINE = 1412.83765
PU_POWER = (1.64593172, 0.431384981, -0.00294139609)  # factor, exponent, offset
PU_LOG = (0.192653254, 0.00626026094, 0.998620152)  # factor, offset of the value, offset
PU_START_POWER, PU_START_LOG = 1.57945760e-6, 0.0322087631
PU_MOST = 3.1351190  # of 65504, the largest half float; encoded values are divided by it
MOST_LIGHT = 65504.0


class Denoiser(nn.Module):
    """The U-Net on encoded images (N, inputs, H, W) of any size; returns (N, 3, H, W).

    ``widths``: channels after each of ``LAYERS``; ``inputs``: 3 for colour, 9 with albedo and normal.
    """

    def __init__(self, widths: Sequence[int] = SMALL, inputs: int = COLOR_INPUTS) -> None:
        super().__init__()
        self.widths, self.inputs = tuple(widths), inputs
        shapes = network_shapes(widths, inputs)
        for layer in LAYERS:
            outputs, entering = shapes[f"{layer}.weight"][:2]
            convolution = nn.Conv2d(entering, outputs, 3, padding=1)
            nn.init.kaiming_normal_(convolution.weight, nonlinearity="relu")
            nn.init.zeros_(convolution.get_parameter("bias"))
            self.add_module(layer, convolution)

    def forward(self, image: Tensor) -> Tensor:
        """Denoise; zeros stand where the library pads."""
        height, width = image.shape[2:]
        x = functional.pad(image, (0, -width % MULTIPLE, 0, -height % MULTIPLE))
        kept = {"input": x}
        for layer in LAYERS:
            if layer in SKIPS:
                x = torch.cat((functional.interpolate(x, scale_factor=2, mode="nearest"), kept[SKIPS[layer]]), 1)
            if layer == LAYERS[-1]:
                with torch.autocast(x.device.type, enabled=False):  # the image itself needs single precision
                    return self.get_submodule(layer)(x.float())[:, :, :height, :width]
            x = functional.relu(self.get_submodule(layer)(x))
            if layer in POOLED:
                x = kept[layer] = functional.max_pool2d(x, 2)
        raise AssertionError("the last layer returns")

    def tensors(self) -> dict[str, Array]:
        """Weights and biases as float32, for ``write_tza``; the library takes half floats alone."""
        return {name: value.detach().cpu().numpy() for name, value in self.state_dict().items()}

    @classmethod
    def from_tensors(cls, tensors: Mapping[str, Array], inputs: int = COLOR_INPUTS) -> Denoiser:
        """Network of the tensors of a TZA file; LfsrError where they are not all of it."""
        network = cls(check_network(tensors, "the network", inputs), inputs)
        network.load_state_dict({name: torch.from_numpy(value.astype(np.float32)) for name, value in tensors.items()})
        return network


def hdr_encode(color: Tensor, input_scale: float = 1.0) -> Tensor:
    """Scene-linear colour >= 0 as the network sees it with ``hdr``, in [0, 1]."""
    y, (factor, exponent, offset), (log_factor, shift, log_offset) = (
        (color * input_scale).nan_to_num(0).clamp(0, MOST_LIGHT), PU_POWER, PU_LOG)
    # Clamped from below, or else the unused branch makes gradients that are no numbers.
    power = factor * y.clamp(min=PU_START_POWER) ** exponent + offset
    log = log_factor * torch.log(y + shift) + log_offset
    return torch.where(y <= PU_START_POWER, y * PU_LINE, torch.where(y <= PU_START_LOG, power, log)) / PU_MOST


def hdr_decode(encoded: Tensor, input_scale: float = 1.0) -> Tensor:
    """Inverse of ``hdr_encode``; values below 0 become 0."""
    x, (factor, exponent, offset), (log_factor, shift, log_offset) = encoded.clamp(min=0) * PU_MOST, PU_POWER, PU_LOG
    start_power, start_log = PU_LINE * PU_START_POWER, factor * PU_START_LOG ** exponent + offset
    power = ((x.clamp(min=start_power) - offset) / factor) ** (1 / exponent)
    log = torch.exp((x - log_offset) / log_factor) - shift
    return torch.where(x <= start_power, x / PU_LINE, torch.where(x <= start_log, power, log)) / input_scale


def normal_encode(normal: Tensor) -> Tensor:
    """Normal in [-1, 1] as the network sees it, in [0, 1]; an albedo in [0, 1] stays as it is."""
    return normal.nan_to_num(0).clamp(-1, 1) / 2 + 0.5


CORE = "*OpenImageDenoise_core*"  # holds the weights
NAMES = {"hdr": (2, 3), "hdr-guided": (6, 7)}  # place of "base" and "small"
SIZES = ("base", "small")
NETWORKS = 23  # weights in libraries 2.3 to 2.5
START = denoise.HEADER.pack(denoise.MAGIC, denoise.VERSION, denoise.MINOR, 0)[:4]


def stock_weights(name: str = "hdr", size: str = "small") -> dict[str, Array]:
    """Tensors (float16) of the library's own network; ``name``: one of NAMES, ``size``: "base" or "small".

    LfsrError where no library is installed, or one of another version.
    """
    if name not in NAMES or size not in SIZES:
        raise LfsrError(f"there are no weights {name!r} of size {size!r}: choose {', '.join(NAMES)} and {SIZES}")
    path = next((core for library in denoise.find_libraries() for core in sorted(library.parent.glob(CORE))), None)
    if path is None:
        raise LfsrError("Open Image Denoise is not installed: install the package pyoidn")
    return _blobs(path)[NAMES[name][SIZES.index(size)]]


@functools.lru_cache(maxsize=1)
def _blobs(path: Path) -> tuple[dict[str, Array], ...]:
    content, networks, start = path.read_bytes(), list[dict[str, Array]](), 0
    while (start := content.find(START, start)) >= 0:
        with contextlib.suppress(LfsrError):  # bytes that happen to be the same
            networks.append(denoise.parse_tza(content[start:start + denoise.MOST_BYTES], path))
        start += len(START)
    if len(networks) != NETWORKS:
        raise LfsrError(f"{path} holds {len(networks)} networks, expected {NETWORKS}: install pyoidn 2.5")
    return tuple(networks)
