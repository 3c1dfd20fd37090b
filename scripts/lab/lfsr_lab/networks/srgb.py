"""The sRGB curve of ``images.srgb`` for tensors."""

from __future__ import annotations

import torch
from torch import Tensor


def srgb_encode(linear: Tensor) -> Tensor:
    """sRGB curve (IEC 61966-2-1) of linear values clipped to [0, 1]; any shape, result in [0, 1]."""
    linear = linear.clamp(0, 1)
    # The power's slope at 0 is infinite, and where() would pass it to the gradient.
    return torch.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: Tensor) -> Tensor:
    """Linear light of sRGB values clipped to [0, 1]; any shape."""
    encoded = encoded.clamp(0, 1)
    return torch.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
