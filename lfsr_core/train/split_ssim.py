"""SSIM and squared error against two noisy reference halves, as training losses.

The reference's own noise cancels (DESIGN: variance by cov(a, b), squared mean
by mean(a)·mean(b)), so a noisy target biases neither value nor gradient.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

SIGMA, RADIUS = 1.5, 5
C1, C2 = 0.01**2, 0.03**2


def blur(maps: Tensor) -> Tensor:
    """Gaussian window, σ = 1.5, 11 taps, reflected borders: (B, C, H, W) -> the same."""
    taps = torch.exp(-torch.arange(-RADIUS, RADIUS + 1, device=maps.device, dtype=torch.float32) ** 2 / (2 * SIGMA**2))
    taps = (taps / taps.sum()).to(maps.dtype)
    b, c, h, w = maps.shape
    x = F.pad(maps.reshape(b * c, 1, h, w), (RADIUS,) * 4, mode="reflect")
    # Variances are differences of nearly equal blurs: the ten bits of TF32 are too few.
    with torch.backends.cudnn.flags(enabled=True, allow_tf32=False):
        x = F.conv2d(x, taps.view(1, 1, 1, -1))
        return F.conv2d(x, taps.view(1, 1, -1, 1)).view(b, c, h, w)


def split_ssim_map(x: Tensor, a: Tensor, b: Tensor) -> Tensor:
    """Local split SSIM of x (B, C, H, W) against the halves a and b, values in [0, 1], range 1."""
    channels = x.shape[1]
    mean = (a + b) / 2
    mx, ma, mb, xx, ab, xm = blur(torch.cat([x, a, b, x * x, a * b, x * mean], 1)).split(channels, 1)
    mm = (ma + mb) / 2
    cov_x, cov_ab, var_x = xm - mx * mm, ab - ma * mb, xx - mx * mx
    # A noisy cov(a, b) can fall below zero; the floor keeps the quotient bounded, as in metrics.
    bottom = (mx * mx + (ma * mb).clamp_min(0) + C1) * ((var_x + cov_ab).clamp_min(0) + C2)
    return (2 * mx * mm + C1) * (2 * cov_x + C2) / bottom


def split_squared_error(x: Tensor, a: Tensor, b: Tensor) -> Tensor:
    """Unbiased squared error map (x - a)·(x - b)."""
    return (x - a) * (x - b)


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of (B, C, H, W) where mask (B, 1, H, W) is 1."""
    return (values * mask).sum() / (mask.sum() * values.shape[1]).clamp_min(1)
