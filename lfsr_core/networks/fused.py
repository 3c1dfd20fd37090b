"""From a network's last convolution straight to 8-bit pixels in place.

Pixel shuffle, scaling to bytes and the order of the image cost a pass over the
high-resolution frame each; folded into the last convolution's weights and one
strided copy, they cost one in all.
"""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn

from lfsr_core.networks.layers import fold_for_inference


class BytePhases(nn.Module):
    """(N, 3, h, w) -> (N, s²·3, h, w): the s×s phases of each pixel, then RGB, times 255 plus ½.

    Made from a network whose last layers, once folded, are a convolution and a pixel shuffle.
    """

    def __init__(self, network: nn.Module, scale: int) -> None:
        super().__init__()
        self.network = fold_for_inference(copy.deepcopy(network))
        self.scale = scale
        last = _drop_shuffle(self.network)
        order = torch.arange(3 * scale**2).view(3, scale**2).t().flatten()
        last.weight = nn.Parameter(last.weight.detach()[order] * 255)
        last.bias = nn.Parameter(last.bias.detach()[order] * 255 + 0.5)

    def forward(self, x: Tensor) -> Tensor:
        return self.network(x)


def write_bytes(phases: Tensor, rows: Tensor, lenses: int, scale: int) -> None:
    """Clip BytePhases' result (N, s²·3, h, w), in place, and write it into N / ``lenses`` whole rows of EIs.

    ``rows``: uint8 (N / lenses · h·s, lenses·w·s, 3), a slice of the image.
    """
    count, _, h, w = phases.shape
    source = phases.clamp_(0, 255).permute(0, 2, 3, 1).view(count // lenses, lenses, h, w, scale, scale, 3)
    place = rows.view(count // lenses, h, scale, lenses, w, scale, 3)
    place.copy_(source.permute(0, 2, 4, 1, 3, 5, 6))


def _drop_shuffle(network: nn.Module) -> nn.Conv2d:
    """Replace the last pixel shuffle by nothing; the convolution before it."""
    owner, name, before, last = None, "", None, None
    for module in network.modules():
        for child_name, child in module.named_children():
            if isinstance(child, nn.Conv2d):
                last = child
            if isinstance(child, nn.PixelShuffle):
                owner, name, before = module, child_name, last
    if owner is None or before is None:
        raise ValueError(f"{type(network).__name__} does not end in a convolution and a pixel shuffle")
    setattr(owner, name, nn.Identity())
    return before
