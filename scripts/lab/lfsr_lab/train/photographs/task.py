"""Task of the training loop: a comparator on photographs, with or without a discriminator, as in the paper."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.metrics.eia_metrics import HALF_WINDOW, SSIM_C1, SSIM_C2
from lfsr_lab.networks import checkpoint, comparators
from lfsr_lab.networks.networks import build
from lfsr_lab.networks.upscalers import srgb_decode, srgb_encode
from lfsr_lab.train.config import TrainConfig
from lfsr_lab.train.loop import open_data

SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff"}


@dataclass(frozen=True)
class Photographs:
    """``names`` and (H, W, 3) uint8 RGB ``images``; ``digest`` is the SHA-256 over both."""

    names: tuple[str, ...]
    images: tuple[Array, ...]

    @property
    def digest(self) -> str:
        """Hexadecimal digits, equal for the same photographs under the same names."""
        state = hashlib.sha256()
        for name, image in zip(self.names, self.images, strict=True):
            state.update(f"{name} {image.shape}\n".encode())
            state.update(image.tobytes())
        return state.hexdigest()

    def facts(self) -> dict[str, Any]:
        pixels = sum(image.shape[0] * image.shape[1] for image in self.images)
        return {"files": len(self.names), "megapixels": round(pixels / 1e6, 2), "sha256": self.digest}


def load_photographs(folder: str | Path, long_side: int | None = None) -> Photographs:
    """Read the photographs of a folder; larger ones are reduced by areas to ``long_side``.

    LfsrError if there are none or one cannot be decoded.
    """
    paths = sorted(path for path in Path(folder).glob("*") if path.suffix.lower() in SUFFIXES)
    if not paths:
        raise LfsrError(f"{folder} holds no photographs ({', '.join(sorted(SUFFIXES))}): give a folder that does")
    images = []
    for path in paths:
        with open_data(path, "a photograph", "remove it or get it again") as file:
            decoded: Any = cv2.imdecode(np.frombuffer(file.read(), np.uint8), cv2.IMREAD_COLOR)
            image = np.ascontiguousarray(decoded[..., ::-1])
        longest = max(image.shape[:2])
        if long_side is not None and longest > long_side:
            size = [round(side * long_side / longest) for side in image.shape[1::-1]]
            image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        images.append(image)
    return Photographs(tuple(path.name for path in paths), tuple(images))


class CropSampler:
    """Random crops of ``size`` pixels, ``per_photograph`` in an epoch, cut on the device that stores the photographs.

    Epoch e depends on (seed, e) alone, so a resumed run sees the same crops as
    an uninterrupted one. LfsrError if a photograph is smaller than a crop.
    """

    def __init__(self, photographs: Photographs, size: int, per_photograph: int, seed: int,
                 device: torch.device) -> None:
        for name, image in zip(photographs.names, photographs.images, strict=True):
            if min(image.shape[:2]) < size:
                raise LfsrError(f"photograph {name} is smaller than a crop of {size} pixels: remove it or "
                                f"choose a smaller crop")
        self._sizes = np.array([image.shape[:2] for image in photographs.images])
        self._starts = np.concatenate([[0], np.cumsum(self._sizes.prod(axis=1))[:-1]])
        pixels = np.concatenate([image.reshape(-1, 3) for image in photographs.images])
        self._pixels = torch.from_numpy(pixels).to(device)
        self._size, self._per_photograph, self._seed = size, per_photograph, seed
        self._ramp = torch.arange(size, device=device)

    def begin(self, epoch: int, batch: int) -> None:
        """Draw the crops of an epoch in batches; a smaller last batch is dropped unless it is the only one."""
        rng = np.random.default_rng([self._seed, epoch])
        photograph = rng.permutation(np.repeat(np.arange(len(self._sizes)), self._per_photograph))
        room = self._sizes[photograph] - self._size + 1
        top, left = (rng.integers(room[:, axis]) for axis in (0, 1))
        width = self._sizes[photograph, 1]
        corner = self._starts[photograph] + top * width + left
        self._turns = rng.integers(8, size=max(1, len(photograph) // batch))
        self._place = torch.from_numpy(np.stack([corner, width], axis=1)).to(self._pixels.device).split(batch)

    def __len__(self) -> int:
        return len(self._turns)

    def __getitem__(self, index: int) -> Tensor:
        """Batch (B, 3, size, size) float32 in [0, 1], flipped and transposed as one."""
        corner, width = self._place[index][:, :, None, None].unbind(1)
        crops = self._pixels[corner + self._ramp[:, None] * width + self._ramp]
        crops = crops.permute(0, 3, 1, 2).float() / 255
        turn = int(self._turns[index])
        axes = [axis for bit, axis in ((1, 2), (2, 3)) if turn & bit]
        crops = crops.flip(axes) if axes else crops
        return crops.transpose(2, 3) if turn & 4 else crops


def downsample(high: Tensor, scale: int) -> Tensor:
    """Average the light of sRGB values (N, 3, H, W) -> (N, 3, H/s, W/s), as a low-resolution render does."""
    return srgb_encode(F.avg_pool2d(srgb_decode(high), scale))


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


BETAS = (0.9, 0.999)


class ComparatorTask:
    """Trains one network of ``comparators.NETWORKS`` as a TrainConfig says; see ``loop.Task``."""

    def __init__(self, config: TrainConfig, photographs: Photographs, validation: Photographs | None,
                 device: torch.device) -> None:
        """Load everything on the device and build the untrained network.

        ``validation`` are photographs for PSNR and SSIM, or None.
        LfsrError if a photograph is smaller than a crop, or the initial weights do not fit.
        """
        torch.manual_seed(config.seed)
        self.config, self.device = config, device
        self._facts = {"photographs": photographs.facts(), "validation": validation.facts() if validation else None}
        self._origin = {"photographs": photographs.digest}
        self._crops = CropSampler(photographs, config.crop, config.crops_per_photograph, config.seed, device)
        self._validation = []  # (low, high) of every photograph, each (1, 3, H, W), cut to a multiple of the scale
        for image in validation.images if validation else ():
            rows, columns = (side // config.scale * config.scale for side in image.shape[:2])
            high = torch.from_numpy(image[:rows, :columns].copy()).to(device).permute(2, 0, 1)[None].float() / 255
            self._validation.append((downsample(high, config.scale), high))
        self.network = build(config.network, config.scale).to(device)
        if config.start:
            checkpoint.load_into(self.network, config.start, config.scale)
            self._origin["start"] = checkpoint.read(config.start)[0]["sha256"]
        self._optimizer = self._adam(self.network)
        self.discriminator: Discriminator | None = None
        if config.adversarial:
            # PyTorch's stubs lack this overload.
            self.discriminator = Discriminator().to(device, memory_format=self._layout)  # type: ignore[call-overload]
            self._adversary = self._adam(self.discriminator)

    @property
    def finished(self) -> nn.Module:
        return self.network

    @property
    def options(self) -> Mapping[str, Any]:
        return comparators.spec(self.config.network).options

    @property
    def _layout(self) -> torch.memory_format:
        return torch.channels_last if self.device.type == "cuda" else torch.contiguous_format

    def _adam(self, module: nn.Module) -> torch.optim.Adam:
        return torch.optim.Adam(module.parameters(), self.config.rate, BETAS, fused=self.device.type == "cuda")

    def data(self) -> dict[str, Any]:
        return self._facts

    def identity(self) -> dict[str, Any]:
        """Settings and data, without how often to log, and without the length of a constant schedule."""
        values = dataclasses.asdict(self.config)
        free = {"photographs", "validation", "validate_every", "checkpoint_every", "start"}
        free |= {"epochs"} if self.config.schedule == "constant" else set()
        return {**{key: value for key, value in values.items() if key not in free}, **self._origin}

    def begin(self, epoch: int) -> int:
        """Draw the crops of an epoch and set its learning rate."""
        self._crops.begin(epoch, self.config.batch)
        if self.config.schedule == "cosine":
            rate = self.config.rate * (1 + math.cos(math.pi * epoch / self.config.epochs)) / 2
            for group in self._optimizer.param_groups:
                group["lr"] = rate
        return len(self._crops)

    def step(self, index: int) -> dict[str, Tensor]:
        """Train on one batch: the discriminator first, if there is one, then the network."""
        high = self._crops[index]
        fake = self.network(downsample(high, self.config.scale))
        mse = F.mse_loss(fake, high)
        if self.discriminator is None:
            self._update(self._optimizer, mse)
            return {"mse": mse.detach()}
        high, fake = (images.contiguous(memory_format=self._layout) for images in (high, fake))
        # Half precision only for the discriminator, which does 99 % of the arithmetic.
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda"):
            judged = discriminator_loss(self.discriminator, high, fake)
        self._update(self._adversary, judged)
        self.discriminator.requires_grad_(False)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda"):
            fooled = adversarial_loss(self.discriminator, fake)
        self._update(self._optimizer, mse + self.config.adversarial * fooled)
        self.discriminator.requires_grad_(True)
        return {"mse": mse.detach(), "adversarial": fooled.detach(), "discriminator": judged.detach()}

    @staticmethod
    def _update(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        return self._quality("validation", self.network)

    def yardstick(self) -> dict[str, float]:
        """Mean PSNR and SSIM of bicubic interpolation, for the provenance."""
        return self._quality("bicubic", lambda low: F.interpolate(low, scale_factor=self.config.scale, mode="bicubic"))

    @torch.no_grad()
    def _quality(self, name: str, upscale: Callable[[Tensor], Tensor]) -> dict[str, float]:
        """Mean PSNR and SSIM over the validation photographs, named after ``name``; empty without photographs."""
        if not self._validation:
            return {}
        # TF32 keeps ten bits: the differences of squares in SSIM need more.
        with torch.backends.cudnn.flags(enabled=True, allow_tf32=False):
            pairs = [(upscale(low).clamp(0, 1), high) for low, high in self._validation]
            metrics = {"psnr": psnr, "ssim": ssim}
            return {f"{name}.{key}": round(float(torch.cat([metric(*pair) for pair in pairs]).mean()), 5)
                    for key, metric in metrics.items()}

    def state(self) -> dict[str, Any]:
        return {name: part.state_dict() for name, part in self._parts().items()}

    def restore(self, state: dict[str, Any]) -> None:
        for name, part in self._parts().items():
            part.load_state_dict(state[name])

    def _parts(self) -> dict[str, nn.Module | torch.optim.Optimizer]:
        parts: dict[str, nn.Module | torch.optim.Optimizer] = {"network": self.network, "optimizer": self._optimizer}
        if self.discriminator is not None:
            parts |= {"discriminator": self.discriminator, "adversary": self._adversary}
        return parts


def discriminator_loss(discriminator: nn.Module, real: Tensor, fake: Tensor) -> Tensor:
    """Binary cross-entropy with real images as 1 and generated ones as 0; ``fake`` is detached here."""
    on_real, on_fake = discriminator(real).float(), discriminator(fake.detach()).float()
    return (F.softplus(-on_real).mean() + F.softplus(on_fake).mean()) / 2


def adversarial_loss(discriminator: nn.Module, fake: Tensor) -> Tensor:
    """Generator's loss -log D(G(x)), which has a gradient even if the discriminator is certain."""
    return F.softplus(-discriminator(fake).float()).mean()


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
    half = torch.from_numpy(HALF_WINDOW).to(maps)
    window = torch.cat([half.flip(0)[:-1], half])
    planes = maps.flatten(0, 1)[:, None]
    planes = F.conv2d(F.conv2d(planes, window[None, None, None]), window[None, None, :, None])
    return planes.reshape(*maps.shape[:2], *planes.shape[2:])
