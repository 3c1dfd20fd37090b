"""PSNR and SSIM on the training device, for validation; published figures come from lfsr_core.metrics."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

SIGMA, RADIUS = 1.5, 5


def psnr(image: Tensor, reference: Tensor) -> Tensor:
    """Decibels of (N, C, H, W) images in [0, 1], one value per image."""
    return -10 * (image - reference).square().mean((1, 2, 3)).clamp_min(1e-12).log10()


def ssim(image: Tensor, reference: Tensor) -> Tensor:
    """SSIM of (N, C, H, W) images in [0, 1], one value per image.

    11×11 Gaussian window, σ = 1.5, no sample covariance, borders left out, mean
    over channels: as Wang et al. 2004 and scikit-image with the same settings.
    """
    c1, c2 = 0.01**2, 0.03**2
    mean_x, mean_y = _blur(image), _blur(reference)
    var_x = _blur(image * image) - mean_x**2
    var_y = _blur(reference * reference) - mean_y**2
    covariance = _blur(image * reference) - mean_x * mean_y
    luminance = (2 * mean_x * mean_y + c1) / (mean_x**2 + mean_y**2 + c1)
    structure = (2 * covariance + c2) / (var_x + var_y + c2)
    return (luminance * structure).mean((1, 2, 3))


def _blur(images: Tensor) -> Tensor:
    ramp = torch.arange(-RADIUS, RADIUS + 1, device=images.device, dtype=images.dtype)
    window = torch.exp(-(ramp / SIGMA) ** 2 / 2)
    window = window / window.sum()
    flat = images.flatten(0, 1)[:, None]
    flat = F.conv2d(F.conv2d(flat, window.view(1, 1, -1, 1)), window.view(1, 1, 1, -1))
    return flat.view(*images.shape[:2], *flat.shape[2:])
