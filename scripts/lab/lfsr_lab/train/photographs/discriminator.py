"""The paper's discriminator, as in SRGAN (Ledig et al. 2017): used in training only.

Eight 3×3 convolutions (64, 64, 128, 128, 256, 256, 512, 512; every second with
stride 2), seven batch normalisations, LeakyReLU 0.2, two fully connected
layers. SRGAN's first fully connected layer sees 6×6 cells, for crops of 96
pixels; larger crops are averaged to 6×6 here, so its size does not grow with
the crop.
"""

from __future__ import annotations

from torch import Tensor, nn

WIDTHS = (64, 64, 128, 128, 256, 256, 512, 512)
CELLS, HIDDEN = 6, 1024


class Discriminator(nn.Module):
    """(N, 3, H, W) images -> (N, 1) logits, positive for "real"."""

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        inputs = 3
        for index, width in enumerate(WIDTHS):
            layers.append(nn.Conv2d(inputs, width, 3, stride=1 + index % 2, padding=1, bias=index == 0))
            layers += [nn.BatchNorm2d(width)] if index else []
            layers.append(nn.LeakyReLU(0.2))
            inputs = width
        self.body = nn.Sequential(*layers, nn.AdaptiveAvgPool2d(CELLS), nn.Flatten())
        self.head = nn.Sequential(nn.Linear(inputs * CELLS**2, HIDDEN), nn.LeakyReLU(0.2), nn.Linear(HIDDEN, 1))

    def forward(self, images: Tensor) -> Tensor:
        """(N, 3, H, W) sRGB values -> (N, 1) logits."""
        return self.head(self.body(images))
