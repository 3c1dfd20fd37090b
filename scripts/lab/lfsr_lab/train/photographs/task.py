"""Task of the training loop: a comparator on photographs, with or without a discriminator, as in the paper."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfsr_lab.networks import checkpoint, comparators
from lfsr_lab.networks.networks import build
from lfsr_lab.train.config import TrainConfig
from lfsr_lab.train.photographs.data import CropSampler, Photographs, downsample
from lfsr_lab.train.photographs.discriminator import Discriminator
from lfsr_lab.train.ssim import psnr, ssim

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
        self._validation = _validation_pairs(validation, config.scale, device) if validation else []
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
        """The network to save when the run has ended."""
        return self.network

    @property
    def options(self) -> Mapping[str, Any]:
        """Hyper-parameters for the header of the weights."""
        return comparators.spec(self.config.network).options

    @property
    def _layout(self) -> torch.memory_format:
        return torch.channels_last if self.device.type == "cuda" else torch.contiguous_format

    def _adam(self, module: nn.Module) -> torch.optim.Adam:
        return torch.optim.Adam(module.parameters(), self.config.rate, BETAS, fused=self.device.type == "cuda")

    def data(self) -> dict[str, Any]:
        """Photographs of the run, for the provenance."""
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
        return self._adversarial_step(self.discriminator, high, fake, mse)

    def _adversarial_step(self, discriminator: Discriminator, high: Tensor, fake: Tensor,
                          mse: Tensor) -> dict[str, Tensor]:
        high, fake = (images.contiguous(memory_format=self._layout) for images in (high, fake))
        # Half precision only for the discriminator, which does 99 % of the arithmetic.
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda"):
            judged = discriminator_loss(discriminator, high, fake)
        self._update(self._adversary, judged)
        discriminator.requires_grad_(False)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda"):
            fooled = adversarial_loss(discriminator, fake)
        self._update(self._optimizer, mse + self.config.adversarial * fooled)
        discriminator.requires_grad_(True)
        return {"mse": mse.detach(), "adversarial": fooled.detach(), "discriminator": judged.detach()}

    @staticmethod
    def _update(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean PSNR and SSIM over the validation photographs."""
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
        """Everything that training changes."""
        return {name: part.state_dict() for name, part in self._parts().items()}

    def restore(self, state: dict[str, Any]) -> None:
        """Return to a ``state``."""
        for name, part in self._parts().items():
            part.load_state_dict(state[name])

    def _parts(self) -> dict[str, nn.Module | torch.optim.Optimizer]:
        parts: dict[str, nn.Module | torch.optim.Optimizer] = {"network": self.network, "optimizer": self._optimizer}
        if self.discriminator is not None:
            parts |= {"discriminator": self.discriminator, "adversary": self._adversary}
        return parts


def _validation_pairs(photographs: Photographs, scale: int, device: torch.device) -> list[tuple[Tensor, Tensor]]:
    """(low, high) of every photograph, each (1, 3, H, W), cut to a multiple of the scale."""
    pairs = []
    for image in photographs.images:
        rows, columns = (side // scale * scale for side in image.shape[:2])
        high = torch.from_numpy(image[:rows, :columns].copy()).to(device).permute(2, 0, 1)[None].float() / 255
        pairs.append((downsample(high, scale), high))
    return pairs


def discriminator_loss(discriminator: nn.Module, real: Tensor, fake: Tensor) -> Tensor:
    """Binary cross-entropy with real images as 1 and generated ones as 0; ``fake`` is detached here."""
    on_real, on_fake = discriminator(real).float(), discriminator(fake.detach()).float()
    return (F.softplus(-on_real).mean() + F.softplus(on_fake).mean()) / 2


def adversarial_loss(discriminator: nn.Module, fake: Tensor) -> Tensor:
    """Generator's loss -log D(G(x)), which has a gradient even if the discriminator is certain."""
    return F.softplus(-discriminator(fake).float()).mean()
