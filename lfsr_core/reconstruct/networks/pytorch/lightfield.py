"""Our network: cleans each low-resolution elemental image so that linear upscaling comes nearest to the truth.

A shallow U of 3×3 convolutions inside one EI, trained through linear upscaling
on noisy renders. A nonlinear upscaling head and convolutions across lenses
(``spatial``, kept for that ablation) gained nothing, see docs/results/networks.md.
"""

from __future__ import annotations

import dataclasses

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfsr_core.reconstruct.networks.numpy_network import LEAST_LIGHT, MAX_GAIN, channels


@dataclasses.dataclass(frozen=True)
class LightFieldConfig:
    """Size and inputs of one network.

    ``inputs`` are layers of the low-resolution EIA in the order the first
    convolution sees them. ``base`` is the layer that the network corrects; ``second_base``
    another picture of the same, which it mixes in pixel by pixel.
    ``width``: channels at full angular resolution; ``body_width``: at half.
    ``blocks``: residual pairs of convolutions; ``spatial`` takes every second one
    across lenses.
    """

    inputs: tuple[str, ...] = ("color", "alpha", "albedo", "normal")
    base: str = "color"
    second_base: str = ""
    width: int = 16
    body_width: int = 32
    blocks: int = 2
    spatial: bool = False

    @property
    def input_channels(self) -> int:
        """Channels of the first convolution: three per layer, one for alpha, one for samples."""
        return channels(self.inputs) + 1

    @property
    def outputs(self) -> int:
        """Channels of the last convolution: correction, share of the base to drop, share of the second base."""
        return 5 if self.second_base else 4


def encode(linear: Tensor) -> Tensor:
    """Scene-linear >= 0 to the working domain of ``upscale.encode``: √x up to 1, 1 + ½·ln x above."""
    # The slope of a root at 0 has no end.
    return linear.clamp(1e-8, 1).sqrt() + 0.5 * linear.clamp_min(1).log()


def decode(encoded: Tensor) -> Tensor:
    """Inverse of ``encode``; negative values become 0."""
    return encoded.clamp(0, 1).square() * (2 * (encoded.clamp_min(1) - 1)).exp()


def display_values(encoded: Tensor) -> Tensor:
    """Working domain to what metrics see: sRGB values clipped to [0, 1]."""
    linear = encoded.clamp(0, 1).square()
    return torch.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


def conserve(encoded: Tensor, light: Tensor) -> Tensor:
    """EIs (N, 3, h, w) of the working domain, scaled to their rendered mean, scene-linear ``light`` (N, 3, 1, 1).

    The render's mean over an EI is unbiased and has little noise; a network's is neither.
    """
    linear = decode(encoded)
    gain = (light + LEAST_LIGHT) / (linear.mean((2, 3), keepdim=True) + LEAST_LIGHT)
    return encode(linear * gain.clamp(1 / MAX_GAIN, MAX_GAIN))


def upscale(low: Tensor, scale: int) -> Tensor:
    """Linear inside each EI, as the method "bilinear": (N, C, h, w) -> (N, C, s·h, s·w)."""
    return F.interpolate(low, scale_factor=scale, mode="bilinear", align_corners=False)


class ReplicateConv(nn.Conv2d):
    """3×3 convolution whose border repeats the edge: an EI has few pixels, and zeros would darken them."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 3, padding=1, padding_mode="replicate")


class Block(nn.Module):
    """Residual pair of convolutions over views; with ``spatial`` the second one is over lenses."""

    def __init__(self, width: int, spatial: bool) -> None:
        super().__init__()
        self.angular = ReplicateConv(width, width)
        self.spatial = ReplicateConv(width, width)
        self.across_lenses = spatial

    def forward(self, x: Tensor, lenses: tuple[int, int]) -> Tensor:
        """(B·sy·sx, C, h, w) -> the same shape; ``lenses`` is (sx, sy)."""
        x = x + F.relu(self.angular(x))
        if not self.across_lenses:
            return x + F.relu(self.spatial(x))
        views = _to_views(x, lenses)
        return x + _to_lenses(F.relu(self.spatial(views)), x.shape)


def _to_views(x: Tensor, lenses: tuple[int, int]) -> Tensor:
    n, c, h, w = x.shape
    sx, sy = lenses
    x = x.view(n // (sx * sy), sy, sx, c, h, w).permute(0, 4, 5, 3, 1, 2)
    return x.reshape(-1, c, sy, sx)


def _to_lenses(views: Tensor, shape: torch.Size) -> Tensor:
    n, c, h, w = shape
    sy, sx = views.shape[-2:]
    views = views.view(n // (sx * sy), h, w, c, sy, sx).permute(0, 4, 5, 3, 1, 2)
    return views.reshape(n, c, h, w)


class LightFieldNet(nn.Module):
    """Denoise a low-resolution EIA, in the working domain; untrained, it gives back ``base``."""

    def __init__(self, config: LightFieldConfig) -> None:
        super().__init__()
        self.config = config
        width, body = config.width, config.body_width
        self.stem = ReplicateConv(config.input_channels, width)
        self.down = nn.Conv2d(width, body, 2, stride=2)
        self.body = nn.ModuleList(Block(body, config.spatial) for _ in range(config.blocks))
        self.up = nn.Conv2d(body, width * 4, 1)
        self.out = ReplicateConv(width, config.outputs)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, features: Tensor, base: Tensor, lenses: tuple[int, int]) -> Tensor:
        """features (N, C, h, w) and base (N, 3, h, w) of B·sy·sx EIs, ``lenses`` (sx, sy) -> (N, 3, h, w)."""
        h, w = features.shape[-2:]
        x = F.relu(self.stem(features))
        x = F.pad(x, (0, w % 2, 0, h % 2), mode="replicate")
        d = F.relu(self.down(x))
        for block in self.body:
            d = block(d, lenses)
        x = F.relu(x + F.pixel_shuffle(self.up(d), 2))[..., :h, :w]
        correction = self.out(x)
        # A gate lets the network drop a hopeless base instead of subtracting it.
        keep = 1 - correction[:, 3:4].clamp(0, 1)
        if self.config.second_base:
            base = torch.lerp(base, self._second_base(features), correction[:, 4:].clamp(0, 1))
        return base * keep + correction[:, :3]

    def _second_base(self, features: Tensor) -> Tensor:
        inputs = self.config.inputs
        start = channels(inputs[:inputs.index(self.config.second_base)])
        return features[:, start:start + 3]


def build(scale: int, **options: object) -> LightFieldNet:
    """Untrained network of ``LightFieldConfig(**options)``; the same at every scale."""
    return LightFieldNet(LightFieldConfig(**options))


def multiply_adds(config: LightFieldConfig) -> float:
    """Multiply-adds per low-resolution pixel."""
    width, body = config.width, config.body_width
    full = 9 * config.input_channels * width + 9 * width * config.outputs
    half = 4 * width * body + 2 * config.blocks * 9 * body * body + body * width * 4
    return full + half / 4
