"""SSIM and squared error against two noisy reference halves, as training losses.

The reference's own noise cancels (DESIGN: variance by cov(a, b), squared mean
by mean(a)·mean(b)), so a noisy target biases neither value nor gradient.
"""

from __future__ import annotations

from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

SIGMA, RADIUS, TILE = 1.5, 5, 40
C1, C2 = 0.01**2, 0.03**2


def blur(maps: Tensor) -> Tensor:
    """Gaussian window, σ = 1.5, 11 taps, reflected borders: (B, C, H, W) -> the same."""
    return _Blur.apply(maps)


class _Blur(torch.autograd.Function):
    """Banded matrix products: on a CPU ten times faster than one-channel convolutions, and so is the gradient."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor) -> Tensor:
        ctx.save_for_backward(maps)
        return _both_ways(F.pad(maps, (RADIUS,) * 4, mode="reflect"))

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        maps, = ctx.saved_tensors
        padded = _both_ways(F.pad(gradient, (2 * RADIUS,) * 4))
        return torch.ops.aten.reflection_pad2d_backward(padded, maps, (RADIUS,) * 4)


def _both_ways(padded: Tensor) -> Tensor:
    return _along_last(_along_last(padded).transpose(-1, -2)).transpose(-1, -2)


def _along_last(padded: Tensor) -> Tensor:
    """(..., n + 2·RADIUS) -> (..., n), in tiles so that the band fills its matrix."""
    length = padded.shape[-1] - 2 * RADIUS
    tile = min(TILE, length)
    count = -(-length // tile)
    padded = F.pad(padded, (0, count * tile - length))
    tiles = padded.unfold(-1, tile + 2 * RADIUS, tile)
    product = tiles.reshape(-1, tile + 2 * RADIUS) @ _band(tile, padded)
    return product.view(*padded.shape[:-1], count * tile)[..., :length]


def _band(tile: int, like: Tensor) -> Tensor:
    """(tile + 2·RADIUS, tile) matrix that holds the window in every column."""
    offset = torch.arange(tile + 2 * RADIUS, device=like.device)[:, None] - torch.arange(tile, device=like.device)
    offset = (offset - RADIUS).to(like.dtype)
    weights = torch.exp(-offset**2 / (2 * SIGMA**2)) * (offset.abs() <= RADIUS)
    return weights / weights[:, :1].sum()


def split_ssim_map(x: Tensor, a: Tensor, b: Tensor) -> Tensor:
    """Local split SSIM of x (B, C, H, W) against the halves a and b, values in [0, 1], range 1."""
    channels = x.shape[1]
    mean = (a + b) / 2
    mx, xx, xm = blur(torch.cat([x, x * x, x * mean], 1)).split(channels, 1)
    ma, mb, ab = blur(torch.cat([a, b, a * b], 1)).split(channels, 1)
    mm = (ma + mb) / 2
    cov_x, cov_ab, var_x = xm - mx * mm, ab - ma * mb, xx - mx * mx
    # A noisy cov(a, b) can fall below zero; the floor keeps the quotient bounded, as in metrics.
    bottom = (mx * mx + (ma * mb).clamp_min(0) + C1) * ((var_x + cov_ab).clamp_min(0) + C2)
    return (2 * mx * mm + C1) * (2 * cov_x + C2) / bottom


def split_error_map(x: Tensor, a: Tensor, b: Tensor, guide: Tensor) -> Tensor:
    """What SSIM punishes, as a loss for noisy halves: local split errors of structure and of mean, normalised.

    1 - SSIM is near their sum over the energies of image and reference. With few samples
    the reference's own energy is too noisy for a denominator: small values count too
    much, and a network learns to sharpen. So the energy of ``guide`` stands for it, a
    cleaner if softer picture, and all energies are constants: what is left is linear in
    the reference.
    """
    channels = x.shape[1]
    mean = (a + b) / 2
    mx, xx, xm = blur(torch.cat([x, x * x, x * mean], 1)).split(channels, 1)
    ma, mb, ab, mg, gg = blur(torch.cat([a, b, a * b, guide, guide * guide], 1)).split(channels, 1)
    mm = (ma + mb) / 2
    structure = (xx - mx * mx) + (ab - ma * mb) - 2 * (xm - mx * mm)
    level = mx * mx + ma * mb - 2 * mx * mm
    contrast = ((xx - mx * mx).clamp_min(0) + (gg - mg * mg).clamp_min(0)).detach()
    return structure / (contrast + C2) + level / ((mx * mx).detach() + mg * mg + C1)


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of (B, C, H, W) where mask (B, 1, H, W) is 1."""
    return (values * mask).sum() / (mask.sum() * values.shape[1]).clamp_min(1)
