"""ESPCN, Shi et al. 2016, at its published size but in RGB.

64 (5×5), 32 (3×3), 3·s² (3×3) and a pixel shuffle; tanh, as in the published
experiments, and zero padding. sRGB-encoded in and out, the output not clipped.
"""

from __future__ import annotations

from torch import Tensor, nn


class ESPCN(nn.Module):
    """(N, 3, h, w) -> (N, 3, s·h, s·w)."""

    def __init__(self, scale: int = 4) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(3, 64, 5, padding=2), nn.Tanh(),
            nn.Conv2d(64, 32, 3, padding=1), nn.Tanh(),
            nn.Conv2d(32, 3 * scale**2, 3, padding=1), nn.PixelShuffle(scale),
        )

    def forward(self, x: Tensor) -> Tensor:
        """sRGB values (N, 3, h, w) -> (N, 3, s·h, s·w), not clipped."""
        return self.body(x)
