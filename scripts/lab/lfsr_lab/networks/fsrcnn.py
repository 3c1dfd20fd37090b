"""FSRCNN(56, 12, 4), Dong et al. 2016, at its published size but in RGB.

Feature extraction, shrinking, mapping, expanding, deconvolution; PReLU, zero
padding, Gaussian initialisation. Published for the luma channel: three
channels in and out here. sRGB-encoded in and out, the output not clipped.
"""

from __future__ import annotations

from torch import Tensor, nn

from lfsr_lab.networks.deconvolution import aligned_deconvolution


class FSRCNN(nn.Module):
    """(N, 3, h, w) -> (N, 3, s·h, s·w)."""

    def __init__(self, scale: int = 4, features: int = 56, shrunk: int = 12, mappings: int = 4) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(3, features, 5, padding=2), nn.PReLU(features)]
        layers += [nn.Conv2d(features, shrunk, 1), nn.PReLU(shrunk)]
        for _ in range(mappings):
            layers += [nn.Conv2d(shrunk, shrunk, 3, padding=1), nn.PReLU(shrunk)]
        layers += [nn.Conv2d(shrunk, features, 1), nn.PReLU(features)]
        self.body = nn.Sequential(*layers)
        self.up = aligned_deconvolution(features, 3, 9, scale)
        self._initialise()

    def forward(self, x: Tensor) -> Tensor:
        """sRGB values (N, 3, h, w) -> (N, 3, s·h, s·w), not clipped."""
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
