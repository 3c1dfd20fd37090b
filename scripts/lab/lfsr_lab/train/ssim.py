"""SSIM and PSNR on the training device, for losses and validation; published values come from ``lfsr_core.metrics``.

The noise of a reference cancels between its two halves (variance by cov(a, b), squared
mean by mean(a)·mean(b), docs/reference/metrics.md), so a noisy target biases neither
value nor gradient. Images are (B, C, H, W) in [0, 1].
"""

from __future__ import annotations

import functools
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from lfsr_core.metrics.split_ssim import SSIM_BORDER, SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW, weights

TILE = 40


def blur(maps: Tensor) -> Tensor:
    """Blur (B, C, H, W) by the window of SSIM, with reflected borders."""
    return _Blur.apply(maps)


class _Blur(torch.autograd.Function):
    """Blur by banded matrix products: on a CPU ten times faster than one-channel convolutions, gradient included."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor) -> Tensor:
        """(..., H, W) maps -> the same size, reflected at the borders."""
        ctx.save_for_backward(maps)
        return _both_ways(F.pad(maps, (SSIM_BORDER,) * 4, mode="reflect"))

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        """Transpose of ``forward``: blur over the padded size, then fold the border back."""
        maps, = ctx.saved_tensors
        padded = _both_ways(F.pad(gradient, (2 * SSIM_BORDER,) * 4))
        return torch.ops.aten.reflection_pad2d_backward(padded, maps, (SSIM_BORDER,) * 4)


def _both_ways(padded: Tensor) -> Tensor:
    return _along_last(_along_last(padded).transpose(-1, -2)).transpose(-1, -2)


def _along_last(padded: Tensor) -> Tensor:
    """(..., n + 2·border) -> (..., n), in tiles, so that the band fills its matrix."""
    length = padded.shape[-1] - 2 * SSIM_BORDER
    tile = min(TILE, length)
    count = -(-length // tile)
    padded = F.pad(padded, (0, count * tile - length))
    tiles = padded.unfold(-1, tile + 2 * SSIM_BORDER, tile)
    product = tiles.reshape(-1, tile + 2 * SSIM_BORDER) @ _band(tile, padded.dtype, padded.device)
    return product.view(*padded.shape[:-1], count * tile)[..., :length]


@functools.cache
def _band(tile: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    """(tile + 2·border, tile) matrix that holds the window in every column."""
    half = torch.from_numpy(weights(SSIM_SIGMA, SSIM_WINDOW))
    offset = (torch.arange(tile + 2 * SSIM_BORDER)[:, None] - torch.arange(tile) - SSIM_BORDER).abs()
    band = torch.where(offset <= SSIM_BORDER, half[offset.clamp_max(SSIM_BORDER)], 0)
    return band.to(device, dtype)


def _blurred(*maps: Tensor) -> tuple[Tensor, ...]:
    return blur(torch.cat(maps, 1)).split(maps[0].shape[1], 1)


def split_ssim_map(x: Tensor, a: Tensor, b: Tensor) -> Tensor:
    """Local split SSIM of x against the halves a and b."""
    mean_x, xx, xm = _blurred(x, x * x, x * ((a + b) / 2))
    mean_a, mean_b, ab = _blurred(a, b, a * b)
    mean = (mean_a + mean_b) / 2
    light = (2 * mean_x * mean + SSIM_C1) / (mean_x * mean_x + (mean_a * mean_b).clamp_min(0) + SSIM_C1)
    # A noisy cov(a, b) can fall below zero; the floor keeps the quotient bounded, as in metrics.
    variances = (xx - mean_x * mean_x + ab - mean_a * mean_b).clamp_min(0)
    return light * (2 * (xm - mean_x * mean) + SSIM_C2) / (variances + SSIM_C2)


def split_error_map(x: Tensor, a: Tensor, b: Tensor, guide: Tensor) -> Tensor:
    """Loss like 1 - SSIM for noisy halves: local split errors of structure and of mean, normalised.

    1 - SSIM is close to their sum divided by the energies of image and reference. With few
    samples the reference's energy is too noisy for a denominator: small values weigh too much,
    and a network learns to sharpen. The energy of ``guide``, a cleaner but softer image, replaces
    it. All energies are constants, so the loss is linear in the reference.
    """
    mean_x, xx, xm = _blurred(x, x * x, x * ((a + b) / 2))
    mean_a, mean_b, ab, mean_g, gg = _blurred(a, b, a * b, guide, guide * guide)
    mean = (mean_a + mean_b) / 2
    structure = (xx - mean_x * mean_x) + (ab - mean_a * mean_b) - 2 * (xm - mean_x * mean)
    level = mean_x * mean_x + mean_a * mean_b - 2 * mean_x * mean
    contrast = ((xx - mean_x * mean_x).clamp_min(0) + (gg - mean_g * mean_g).clamp_min(0)).detach()
    return structure / (contrast + SSIM_C2) + level / ((mean_x * mean_x).detach() + mean_g * mean_g + SSIM_C1)


def ssim(image: Tensor, reference: Tensor) -> Tensor:
    """Plain SSIM without borders, mean over channels, one value per image; equals scikit-image's."""
    inside = slice(SSIM_BORDER, -SSIM_BORDER)
    return split_ssim_map(image, reference, reference)[..., inside, inside].mean((1, 2, 3))


def psnr(image: Tensor, reference: Tensor) -> Tensor:
    """Decibels, one value per image."""
    return -10 * (image - reference).square().mean((1, 2, 3)).clamp_min(1e-12).log10()


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of (B, C, H, W) where mask (B, 1, H, W) is 1."""
    return (values * mask).sum() / (mask.sum() * values.shape[1]).clamp_min(1)
