"""Comparators as PyTorch modules: untrained, or with their weights."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from lfsr_core.base.messages import LfsrError
from lfsr_lab.networks import comparators
from lfsr_lab.networks.checkpoint import load_into


def aligned_deconvolution(inputs: int, outputs: int, kernel: int, scale: int) -> nn.ConvTranspose2d:
    """Return a deconvolution from (h, w) to exactly (scale·h, scale·w), its kernel centred on the pixel's footprint.

    ``inputs``, ``outputs``: channels. ``kernel``: its side in output pixels. ``scale``: stride.
    """
    padding = (kernel - scale + 1) // 2
    return nn.ConvTranspose2d(inputs, outputs, kernel, scale, padding, output_padding=2 * padding - kernel + scale)


def deconvolution_as_shuffle(layer: nn.ConvTranspose2d) -> nn.Sequential:
    """Return the same map as a stride-1 convolution and a pixel shuffle, which CPUs run several times faster.

    Output pixel s·i + r takes kernel tap r + p - s·d from input pixel i + d. Exact
    for layers of ``aligned_deconvolution`` (same scale and kernel in both axes).
    """
    assert layer.bias is not None
    scale, padding, kernel = layer.stride[0], int(layer.padding[0]), layer.kernel_size[0]
    reach = max(kernel - 1 - padding, scale - 1 + padding) // scale
    convolution = nn.Conv2d(layer.in_channels, layer.out_channels * scale**2, 2 * reach + 1, padding=reach)
    weight, size = layer.weight.detach(), 2 * reach + 1  # (in, out, k, k)
    # Pad the kernel so that tap r + p - s·d is always inside, with zeros where the layer has none.
    before = scale * reach - padding
    padded = F.pad(weight, (before, size * scale - before - kernel) * 2)
    taps = padded.view(*weight.shape[:2], size, scale, size, scale).flip(2, 4).permute(1, 3, 5, 0, 2, 4)
    convolution.weight = nn.Parameter(taps.reshape(-1, weight.shape[0], size, size).contiguous())
    convolution.bias = nn.Parameter(layer.bias.detach().repeat_interleave(scale**2))
    return nn.Sequential(convolution, nn.PixelShuffle(scale))


def fold_for_inference(network: nn.Module) -> nn.Module:
    """Replace every deconvolution of a network, in place, by a convolution and a pixel shuffle; return it."""
    for name, child in network.named_children():
        if isinstance(child, nn.ConvTranspose2d):
            setattr(network, name, deconvolution_as_shuffle(child))
        else:
            fold_for_inference(child)
    return network.eval()


class PaperGenerator(nn.Module):
    """The paper's generator: ``convolutions`` from 2 to 6, ReLU after each, and one 9×9 deconvolution.

    3 -> 32 (5×5), 32 -> 16 (3×3), and 16 -> 16 (3×3) for every further convolution.
    """

    def __init__(self, scale: int = 4, convolutions: int = 2) -> None:
        super().__init__()
        if not 2 <= convolutions <= 6:
            raise LfsrError(f"the paper's generator has 2 to 6 convolutions, not {convolutions}")
        layers: list[nn.Module] = [nn.Conv2d(3, 32, 5, padding=2), nn.ReLU()]
        for index in range(convolutions - 1):
            layers += [nn.Conv2d(16 if index else 32, 16, 3, padding=1), nn.ReLU()]
        self.body = nn.Sequential(*layers)
        self.up = aligned_deconvolution(16, 3, 9, scale)

    def forward(self, x: Tensor) -> Tensor:
        return self.up(self.body(x))


class ESPCN(nn.Module):
    """ESPCN, Shi et al. 2016, at its published size but in RGB; tanh, as in the published experiments."""

    def __init__(self, scale: int = 4) -> None:
        super().__init__()
        self.body = nn.Sequential(nn.Conv2d(3, 64, 5, padding=2), nn.Tanh(), nn.Conv2d(64, 32, 3, padding=1), nn.Tanh(),
                                  nn.Conv2d(32, 3 * scale**2, 3, padding=1), nn.PixelShuffle(scale),)

    def forward(self, x: Tensor) -> Tensor:
        return self.body(x)


class FSRCNN(nn.Module):
    """FSRCNN(56, 12, 4), Dong et al. 2016, at its published size but in RGB instead of luma.

    Feature extraction, shrinking, mapping, expanding, deconvolution; PReLU, Gaussian initialisation.
    """

    def __init__(self, scale: int = 4) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(3, 56, 5, padding=2), nn.PReLU(56), nn.Conv2d(56, 12, 1), nn.PReLU(12)]
        for _ in range(4):
            layers += [nn.Conv2d(12, 12, 3, padding=1), nn.PReLU(12)]
        layers += [nn.Conv2d(12, 56, 1), nn.PReLU(56)]
        self.body = nn.Sequential(*layers)
        self.up = aligned_deconvolution(56, 3, 9, scale)
        for layer in self.body:
            if isinstance(layer, nn.Conv2d):
                fan_out = layer.out_channels * layer.weight[0, 0].numel()
                nn.init.normal_(layer.weight, std=(2 / fan_out) ** 0.5)
        nn.init.normal_(self.up.weight, std=0.001)
        for name, values in self.named_parameters():
            if name.endswith("bias"):
                nn.init.zeros_(values)

    def forward(self, x: Tensor) -> Tensor:
        return self.up(self.body(x))

ARCHITECTURES: dict[str, Callable[..., nn.Module]] = {
    "PaperGenerator": PaperGenerator, "ESPCN": ESPCN, "FSRCNN": FSRCNN}


def build(name: str, scale: int) -> nn.Module:
    """Return an untrained network; LfsrError if it does not exist at that scale."""
    entry = comparators.spec(name)
    if scale not in comparators.SCALES:
        scales = ", ".join(map(str, comparators.SCALES))
        raise LfsrError(f"network {name!r} has no scale {scale}: choose one of {scales} or another method")
    return ARCHITECTURES[entry.architecture](scale=scale, **entry.options)


def load(name: str, scale: int, weights: str | Path | None = None) -> nn.Module:
    """Return a network with its weights, in evaluation mode, on the CPU; LfsrError if they do not fit."""
    network = build(name, scale)
    shipped = comparators.spec(name).weights
    path = Path(weights) if weights else shipped.get(scale)
    if path is None:
        scales = ", ".join(map(str, shipped)) or "no scale"
        raise LfsrError(f"network {name!r} has no weights for scale {scale} (there are some for {scales}): "
                        f"choose another scale or method, or train them with 'lfsr train'")
    return load_into(network, path, scale).eval()


def parameters(network: nn.Module) -> int:
    return sum(parameter.numel() for parameter in network.parameters())


def multiply_adds(network: nn.Module, h: int, w: int) -> float:
    """Count the multiply-adds per low-resolution pixel of one elemental image of h × w pixels by running the network.

    Convolutions, deconvolutions and linear layers count (padding included, as
    hardware multiplies it too); activations, additions and resampling do not.
    """
    like = next(network.parameters())
    with FlopCounterMode(display=False) as counter, torch.no_grad():
        network(like.new_zeros(1, 3, h, w))
    return counter.get_total_flops() / 2 / (h * w)  # torch counts the multiply and the add
