"""Architectures of the comparators, all trained on photographs: the paper's generator, ESPCN and FSRCNN.

Each maps sRGB-encoded RGB (N, 3, h, w) in [0, 1] to (N, 3, s·h, s·w), not clipped, with zero padding.
"""

from __future__ import annotations

from torch import Tensor, nn

from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks.deconvolution import aligned_deconvolution


class PaperGenerator(nn.Module):
    """The paper's generator: ``convolutions`` from 2 to 6, ReLU after each, and one 9×9 deconvolution.

    3 -> 32 (5×5), 32 -> 16 (3×3), and 16 -> 16 (3×3) for every further convolution.
    """

    def __init__(self, scale: int = 4, convolutions: int = 2) -> None:
        super().__init__()
        if not 2 <= convolutions <= 6:
            raise LfsrError(f"the paper's generator has 2 to 6 convolutions, not {convolutions}")
        layers: list[nn.Module] = [nn.Conv2d(3, 32, 5, padding=2), nn.ReLU()]
        for index in range(convolutions - 1):
            layers += [nn.Conv2d(16 if index else 32, 16, 3, padding=1), nn.ReLU()]
        self.body = nn.Sequential(*layers)
        self.up = aligned_deconvolution(16, 3, 9, scale)

    def forward(self, x: Tensor) -> Tensor:
        """sRGB values (N, 3, h, w) -> (N, 3, s·h, s·w)."""
        return self.up(self.body(x))


class ESPCN(nn.Module):
    """ESPCN, Shi et al. 2016, at its published size but in RGB; tanh, as in the published experiments."""

    def __init__(self, scale: int = 4) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(3, 64, 5, padding=2), nn.Tanh(),
            nn.Conv2d(64, 32, 3, padding=1), nn.Tanh(),
            nn.Conv2d(32, 3 * scale**2, 3, padding=1), nn.PixelShuffle(scale),
        )

    def forward(self, x: Tensor) -> Tensor:
        """sRGB values (N, 3, h, w) -> (N, 3, s·h, s·w)."""
        return self.body(x)


class FSRCNN(nn.Module):
    """FSRCNN(56, 12, 4), Dong et al. 2016, at its published size but in RGB instead of luma.

    Feature extraction, shrinking, mapping, expanding, deconvolution; PReLU, Gaussian initialisation.
    """

    def __init__(self, scale: int = 4) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(3, 56, 5, padding=2), nn.PReLU(56), nn.Conv2d(56, 12, 1), nn.PReLU(12)]
        for _ in range(4):
            layers += [nn.Conv2d(12, 12, 3, padding=1), nn.PReLU(12)]
        layers += [nn.Conv2d(12, 56, 1), nn.PReLU(56)]
        self.body = nn.Sequential(*layers)
        self.up = aligned_deconvolution(56, 3, 9, scale)
        self._initialise()

    def forward(self, x: Tensor) -> Tensor:
        """sRGB values (N, 3, h, w) -> (N, 3, s·h, s·w)."""
        return self.up(self.body(x))

    def _initialise(self) -> None:
        for layer in self.body:
            if isinstance(layer, nn.Conv2d):
                fan_out = layer.out_channels * layer.weight[0, 0].numel()
                nn.init.normal_(layer.weight, std=(2 / fan_out) ** 0.5)
        nn.init.normal_(self.up.weight, std=0.001)
        for name, values in self.named_parameters():
            if name.endswith("bias"):
                nn.init.zeros_(values)
