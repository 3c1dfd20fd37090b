"""Our network: it denoises each low-resolution elemental image for linear upscaling.

A shallow U of 3×3 convolutions inside one EI, trained through linear upscaling
on noisy renders. A nonlinear upscaling head and convolutions across lenses
gained nothing, see docs/notebook/networks.md.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfsr_core.reconstruct.networks.numpy_network import LEAST_LIGHT, MAX_GAIN, channels
from lfsr_lab.networks.srgb import srgb_encode


@dataclasses.dataclass(frozen=True)
class LightFieldConfig:
    """Size and inputs of one network."""

    # layers of the low-resolution EIA, in the order that the first convolution sees them
    inputs: tuple[str, ...] = ("color", "alpha", "albedo", "normal")
    base: str = "color"  # the layer that the network corrects
    second_base: str = ""  # another denoised layer, which it mixes in pixel by pixel; "" for none
    plain: float = 0.0  # fraction of the mean of both in the result
    width: int = 16  # channels at full angular resolution
    body_width: int = 32  # channels at half of it
    blocks: int = 2  # residual pairs of convolutions

    @property
    def input_channels(self) -> int:
        """Channels of the first convolution: three per layer, one for alpha, one for samples."""
        return channels(self.inputs) + 1

    @property
    def outputs(self) -> int:
        """Channels of the last convolution: correction, fraction of the base to drop, fraction of the second base."""
        return 5 if self.second_base else 4


def encode(linear: Tensor) -> Tensor:
    """Convert scene-linear values >= 0 to the working domain of ``encoding.encode``: √x up to 1, 1 + ½·ln x above."""
    # The slope of a root at 0 is infinite.
    return linear.clamp(1e-8, 1).sqrt() + 0.5 * linear.clamp_min(1).log()


def decode(encoded: Tensor) -> Tensor:
    """Inverse of ``encode``; negative values become 0."""
    return encoded.clamp(0, 1).square() * (2 * (encoded.clamp_min(1) - 1)).exp()


def display_values(encoded: Tensor, behind: Tensor | float = 0.0) -> Tensor:
    """Convert the working domain to the sRGB values in [0, 1] that metrics see, over scene-linear light ``behind``."""
    return srgb_encode(encoded.clamp(0, 1).square() + behind)


def conserve(encoded: Tensor, light: Tensor) -> Tensor:
    """Scale EIs (N, 3, h, w) of the working domain to their rendered mean, scene-linear ``light`` (N, 3, 1, 1).

    The render's mean over an EI is unbiased and has little noise; a network's is neither.
    """
    linear = decode(encoded)
    gain = (light + LEAST_LIGHT) / (linear.mean((2, 3), keepdim=True) + LEAST_LIGHT)
    return encode(linear * gain.clamp(1 / MAX_GAIN, MAX_GAIN))


def upscale(low: Tensor, scale: int) -> Tensor:
    """Interpolate linearly inside each EI, as the method "bilinear": (N, C, h, w) -> (N, C, s·h, s·w)."""
    return F.interpolate(low, scale_factor=scale, mode="bilinear", align_corners=False)


class ReplicateConv(nn.Conv2d):
    """3×3 convolution that repeats the edge: an EI has few pixels, and zeros would darken its border."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 3, padding=1, padding_mode="replicate")


class Block(nn.Module):
    """Residual pair of convolutions over the views of an elemental image."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.angular = ReplicateConv(width, width)
        self.spatial = ReplicateConv(width, width)  # over views as well: the name is that of the weights files

    def forward(self, x: Tensor) -> Tensor:
        """(N, C, h, w) -> the same shape."""
        x = x + F.relu(self.angular(x))
        return x + F.relu(self.spatial(x))


class LightFieldNet(nn.Module):
    """Denoise a low-resolution EIA in the working domain; an untrained network returns ``base``.

    With a second base, ``plain`` of the result is always the mean of both.
    """

    def __init__(self, config: LightFieldConfig) -> None:
        super().__init__()
        self.config = config
        width, body = config.width, config.body_width
        self.stem = ReplicateConv(config.input_channels, width)
        self.down = nn.Conv2d(width, body, 2, stride=2)
        self.body = nn.ModuleList(Block(body) for _ in range(config.blocks))
        self.up = nn.Conv2d(body, width * 4, 1)
        self.out = ReplicateConv(width, config.outputs)
        for values in self.out.parameters():
            nn.init.zeros_(values)

    def forward(self, features: Tensor, base: Tensor) -> Tensor:
        """features (N, C, h, w) and base (N, 3, h, w) of N EIs -> (N, 3, h, w)."""
        h, w = features.shape[-2:]
        x = F.relu(self.stem(features))
        x = F.pad(x, (0, w % 2, 0, h % 2), mode="replicate")
        d = F.relu(self.down(x))
        for block in self.body:
            d = block(d)
        x = F.relu(x + F.pixel_shuffle(self.up(d), 2))[..., :h, :w]
        correction = self.out(x)
        # A gate lets the network drop a hopeless base instead of subtracting it.
        keep = 1 - correction[:, 3:4].clamp(0, 1)
        if not self.config.second_base:
            return base * keep + correction[:, :3]
        start = channels(self.config.inputs[:self.config.inputs.index(self.config.second_base)])
        second = features[:, start:start + 3]
        mixed = torch.lerp(base, second, correction[:, 4:].clamp(0, 1)) * keep + correction[:, :3]
        return torch.lerp(mixed, (base + second) / 2, self.config.plain)


def build(scale: int, **options: Any) -> LightFieldNet:
    """Return an untrained network of ``LightFieldConfig(**options)``; it is the same at every scale."""
    return LightFieldNet(LightFieldConfig(**options))
