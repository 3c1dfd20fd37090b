"""The paper's generator: a few convolutions and one deconvolution, per elemental image.

3 -> 32 (5×5), 32 -> 16 (3×3), 16 -> 16 (3×3) for every further convolution, and
a 9×9 deconvolution of stride ``scale`` from 16 to 3. ReLU after each
convolution, zero padding. Input and output are sRGB-encoded RGB in [0, 1]; the
output is not clipped.
"""

from __future__ import annotations

from torch import Tensor, nn

from lfsr_core.errors import LfsrError
from lfsr_lab.networks.deconvolution import aligned_deconvolution

WIDE, NARROW, KERNEL = 32, 16, 9


class PaperGenerator(nn.Module):
    """(N, 3, h, w) -> (N, 3, s·h, s·w); ``convolutions`` from 2 to 6."""

    def __init__(self, scale: int = 4, convolutions: int = 2) -> None:
        super().__init__()
        if not 2 <= convolutions <= 6:
            raise LfsrError(f"the paper's generator has 2 to 6 convolutions, not {convolutions}")
        layers: list[nn.Module] = [nn.Conv2d(3, WIDE, 5, padding=2), nn.ReLU()]
        for index in range(convolutions - 1):
            inputs = WIDE if index == 0 else NARROW
            layers += [nn.Conv2d(inputs, NARROW, 3, padding=1), nn.ReLU()]
        self.body = nn.Sequential(*layers)
        self.up = aligned_deconvolution(NARROW, 3, KERNEL, scale)

    def forward(self, x: Tensor) -> Tensor:
        """sRGB values (N, 3, h, w) -> (N, 3, s·h, s·w), not clipped."""
        upscaled: Tensor = self.up(self.body(x))
        return upscaled
