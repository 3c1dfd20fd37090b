"""SSIM and PSNR on the training device, for validation; published values come from ``lfsr_core.metrics``.

Images are (B, C, H, W) in [0, 1].
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from lfsr_core.metrics.split_ssim import SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW, weights


def ssim(image: Tensor, reference: Tensor) -> Tensor:
    """Plain SSIM without borders, mean over channels, one value per image; equals scikit-image's."""
    mean_x, mean_y = _blurred(image), _blurred(reference)
    variances = _blurred(image * image) - mean_x**2 + _blurred(reference * reference) - mean_y**2
    covariance = _blurred(image * reference) - mean_x * mean_y
    light = (2 * mean_x * mean_y + SSIM_C1) / (mean_x**2 + mean_y**2 + SSIM_C1)
    return (light * (2 * covariance + SSIM_C2) / (variances + SSIM_C2)).mean((1, 2, 3))


def psnr(image: Tensor, reference: Tensor) -> Tensor:
    """Decibels, one value per image."""
    return -10 * (image - reference).square().mean((1, 2, 3)).clamp_min(1e-12).log10()


def _blurred(maps: Tensor) -> Tensor:
    """Blur by the window of SSIM, without the border: (B, C, H - window + 1, W - window + 1)."""
    half = torch.from_numpy(weights(SSIM_SIGMA, SSIM_WINDOW)).to(maps)
    window = torch.cat([half.flip(0)[:-1], half])
    planes = maps.flatten(0, 1)[:, None]
    planes = F.conv2d(F.conv2d(planes, window[None, None, None]), window[None, None, :, None])
    return planes.reshape(*maps.shape[:2], *planes.shape[2:])
