"""Deconvolutions that fit an EI's footprint, and the same as a convolution and a pixel shuffle."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor, nn


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
    weight = _shuffled_weight(layer.weight.detach(), scale, padding, reach)
    convolution.weight = nn.Parameter(weight)
    convolution.bias = nn.Parameter(layer.bias.detach().repeat_interleave(scale**2))
    return nn.Sequential(convolution, nn.PixelShuffle(scale))


def _shuffled_weight(weight: Tensor, scale: int, padding: int, reach: int) -> Tensor:
    """(in, out, k, k) of a deconvolution -> (out·s², in, 2·reach+1, 2·reach+1)."""
    inputs, outputs, kernel, _ = weight.shape
    size = 2 * reach + 1
    # Pad the kernel so that tap r + p - s·d is always inside, with zeros where the layer has none.
    before = scale * reach - padding
    padded = F.pad(weight, (before, size * scale - before - kernel) * 2)
    taps = padded.view(inputs, outputs, size, scale, size, scale).flip(2, 4)
    return taps.permute(1, 3, 5, 0, 2, 4).reshape(outputs * scale**2, inputs, size, size).contiguous()


def fold_for_inference(network: nn.Module) -> nn.Module:
    """Replace every deconvolution of a network, in place, by a convolution and a pixel shuffle; return it."""
    for name, child in network.named_children():
        if isinstance(child, nn.ConvTranspose2d):
            setattr(network, name, deconvolution_as_shuffle(child))
        else:
            fold_for_inference(child)
    return network.eval()
