"""Our network: joint denoising across lenses and views, then per-EI upscaling.

A low-resolution EIA is a 4D light field, so the body alternates 3×3
convolutions inside each elemental image (angular) with 3×3 convolutions across
lenses at one view (spatial), both at half angular resolution. The denoised
views are upscaled inside each EI by a learned linear filter that starts as
bicubic; no pixel of another EI enters that step.
"""

from __future__ import annotations

import dataclasses

import torch
import torch.nn.functional as F
from torch import Tensor, nn

SRGB_SLOPE_AT_ONE = 1.055 / 2.4
FILTER_SIZE = 5
MAX_LOG2_SAMPLES = 12.0


@dataclasses.dataclass(frozen=True)
class LightFieldConfig:
    """Size and inputs of one network.

    ``inputs`` are layers of the low-resolution EIA in the order the first
    convolution sees them; "color" comes first. ``base`` is the layer the
    network corrects. ``width``: channels at full angular resolution;
    ``body_width``: at half. ``blocks``: angular-spatial pairs. ``detail``: adds a
    nonlinear per-EI residual to the linear upscaling.
    """

    scale: int = 4
    inputs: tuple[str, ...] = ("color", "alpha", "albedo", "normal")
    base: str = "color"
    width: int = 16
    body_width: int = 32
    blocks: int = 2
    spatial: bool = True
    detail: bool = False

    @property
    def input_channels(self) -> int:
        """Channels of the first convolution: three per layer, one for alpha, one for samples."""
        return sum(1 if name == "alpha" else 3 for name in self.inputs) + 1


def encode(linear: Tensor) -> Tensor:
    """Scene-linear to working domain: the sRGB curve to 1, its tangent logarithm above."""
    low = linear.clamp(0, 1)
    curve = torch.where(low <= 0.0031308, low * 12.92, 1.055 * low.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)
    return curve + SRGB_SLOPE_AT_ONE * linear.clamp_min(1).log()


def decode(encoded: Tensor) -> Tensor:
    """Inverse of ``encode``; negative values become 0."""
    low = encoded.clamp(0, 1)
    curve = torch.where(low <= 0.04045, low / 12.92, ((low + 0.055) / 1.055) ** 2.4)
    return curve * (encoded.clamp_min(1).sub(1) / SRGB_SLOPE_AT_ONE).exp()


def bicubic_filter(scale: int, size: int = FILTER_SIZE) -> Tensor:
    """Polyphase bicubic (a = -0.75, as torch and OpenCV): (scale², 1, size, size)."""
    impulse = torch.zeros(1, 1, 4 * size + 1, 4 * size + 1)
    impulse[..., 2 * size, 2 * size] = 1
    big = F.interpolate(impulse, scale_factor=scale, mode="bicubic", align_corners=False)[0, 0]
    rows = [_phase_taps(big, scale, size, phase) for phase in range(scale * scale)]
    return torch.stack(rows)[:, None]


def _phase_taps(big: Tensor, scale: int, size: int, phase: int) -> Tensor:
    row, column = divmod(phase, scale)
    reach = size // 2
    # The response of output pixel (s·i + phase) to the input pixel `tap` away is the
    # impulse response read backwards.
    index = [(2 * size - tap) * scale for tap in range(-reach, size - reach)]
    return torch.stack([torch.stack([big[y + row, x + column] for x in index]) for y in index])


class ReplicateConv(nn.Conv2d):
    """3×3 convolution whose border repeats the edge: an EI has few pixels, and zeros would darken them."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 3, padding=1, padding_mode="replicate")


class AngularSpatialBlock(nn.Module):
    """Residual pair: one convolution over views, one over lenses."""

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
    """Denoise a low-resolution EIA and upscale each EI; all in the working domain."""

    def __init__(self, config: LightFieldConfig) -> None:
        super().__init__()
        self.config = config
        width, body = config.width, config.body_width
        self.stem = ReplicateConv(config.input_channels, width)
        self.down = nn.Conv2d(width, body, 2, stride=2)
        self.body = nn.ModuleList(AngularSpatialBlock(body, config.spatial) for _ in range(config.blocks))
        self.up = nn.Conv2d(body, width * 4, 1)
        self.out = ReplicateConv(width, 4)
        self.filter = nn.Parameter(bicubic_filter(config.scale))
        self.detail = ReplicateConv(width, 3 * config.scale**2) if config.detail else None
        for layer in (self.out, self.detail):
            if layer is not None:
                nn.init.zeros_(layer.weight)
                nn.init.zeros_(layer.bias)

    def forward(self, features: Tensor, base: Tensor, lenses: tuple[int, int]) -> Tensor:
        """features (N, C, h, w) and base (N, 3, h, w), N = B·sy·sx -> (N, 3, s·h, s·w)."""
        clean, hidden = self.denoise(features, base, lenses)
        return self.upscale(clean, hidden)

    def denoise(self, features: Tensor, base: Tensor, lenses: tuple[int, int]) -> tuple[Tensor, Tensor]:
        """Denoised views (N, 3, h, w) and the features (N, width, h, w) behind them."""
        h, w = features.shape[-2:]
        x = F.relu(self.stem(features))
        x = F.pad(x, (0, w % 2, 0, h % 2), mode="replicate")
        d = F.relu(self.down(x))
        for block in self.body:
            d = block(d, lenses)
        x = F.relu(x + F.pixel_shuffle(self.up(d), 2))[..., :h, :w]
        correction = self.out(x)
        # A gate lets the network drop a hopeless base instead of subtracting it.
        keep = 1 - correction[:, 3:].clamp(0, 1)
        return base * keep + correction[:, :3], x

    def upscale(self, clean: Tensor, hidden: Tensor) -> Tensor:
        """(N, 3, h, w) -> (N, 3, s·h, s·w) inside each EI, borders replicated."""
        n, _, h, w = clean.shape
        reach = FILTER_SIZE // 2
        padded = F.pad(clean, (reach,) * 4, mode="replicate")
        phases = F.conv2d(padded.reshape(n * 3, 1, h + 2 * reach, w + 2 * reach), self.filter.to(clean.dtype))
        phases = phases.view(n, 3 * self.config.scale**2, h, w)
        if self.detail is not None:
            phases = phases + self.detail(hidden)
        return F.pixel_shuffle(phases, self.config.scale)


def multiply_adds(config: LightFieldConfig) -> float:
    """Multiply-adds per low-resolution pixel."""
    width, body, phases = config.width, config.body_width, 3 * config.scale**2
    full = 9 * config.input_channels * width + 9 * width * 4 + phases * FILTER_SIZE**2
    half = 4 * width * body + 2 * config.blocks * 9 * body * body + body * width * 4
    return full + half / 4 + (9 * width * phases if config.detail else 0)
