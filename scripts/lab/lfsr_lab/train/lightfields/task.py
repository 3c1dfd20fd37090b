"""Task of the training loop: our networks on rendered light fields."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from einops import rearrange
from torch import Tensor

from lfsr_core.files import read_json
from lfsr_lab.networks.lightfield import LightFieldNet, conserve, display_values, encode, upscale
from lfsr_lab.train.config import LightFieldTrainConfig
from lfsr_lab.train.lightfields.data import Batch, Scene, from_eis, make_batch, network_inputs, to_eis
from lfsr_lab.train.ssim import blur, masked_mean, split_error_map

EMA_DECAY = 0.998
SCENES_PER_VALIDATION = 12
SCENE_SETTINGS = "settings.json"  # of training_scenes.py
WARM_UP_STEPS = 200
MIN_RATE = 0.01
SAMPLE_WEIGHT = 0.4
MAX_DARKENING = 0.1
VIEW_WEIGHT, PIXEL_WEIGHT = 0.5, 10.0  # of the losses over decoded views and pixels; that of the EIA weighs 1


def loss_terms(output: Tensor, batch: Batch) -> dict[str, Tensor]:
    """Losses of upscaled output (N, 3, H', W') over foreground EIs.

    ``eia`` and ``views``: normalised errors of display values, close to 1 - SSIM;
    ``pixel``: split squared error in the working domain, where highlights count.
    """
    raw = from_eis(output.float(), batch.lenses)
    halves = [encode(half) for half in batch.halves.unbind(1)]
    width = batch.layers["guide"].shape[-1] * batch.lenses[0]
    guide = upscale(encode(batch.layers["guide"]), raw.shape[-1] // width)
    guide = display_values(from_eis(guide, batch.lenses))
    lost = noise_darkening(*batch.halves.unbind(1))
    a, b = (display_values(half) + lost for half in halves)
    image, mask = display_values(raw), foreground(batch, raw.shape)
    return {"eia": masked_mean(split_error_map(image, a, b, guide), mask),
            "views": _views_error((image, a, b, guide), mask, batch.lenses),
            "pixel": masked_mean((raw - halves[0]) * (raw - halves[1]), mask)}


def noise_darkening(a: Tensor, b: Tensor) -> Tensor:
    """Loss of mean brightness of a noisy half through the sRGB curve: -½·f''(x)·σ², f = 1.055·x^(1/2.4).

    ``a``, ``b`` (B, 3, H, W) scene-linear; σ² of a half comes from their differences nearby.
    """
    variance, level = blur((a - b).square() / 2), blur((a + b) / 2).clamp_min(0.01)
    curvature = 1.055 / 2.4 * (1 - 1 / 2.4) * level ** (1 / 2.4 - 2)
    return (curvature / 2 * variance).clamp_max(MAX_DARKENING) * (level < 1)


def foreground(batch: Batch, shape: torch.Size) -> Tensor:
    """Mask (B, 1, H, W) of EIs in which any ray of the low-resolution render hit something."""
    hit = batch.layers["alpha"].amax((1, 2, 3), keepdim=True) > 0
    sx, sy = batch.lenses
    size = (shape[-2] // sy, shape[-1] // sx)
    return from_eis(hit.float().expand(-1, 1, *size), batch.lenses)


def _views_error(images: tuple[Tensor, ...], mask: Tensor, lenses: tuple[int, int], stride: int = 3) -> Tensor:
    """Mean normalised error of every ``stride``-th decoded view: small images, one pixel per lens."""
    px, py = mask.shape[-1] // lenses[0], mask.shape[-2] // lenses[1]
    rows = torch.arange(torch.randint(stride, ()).item(), py, stride)
    columns = torch.arange(torch.randint(stride, ()).item(), px, stride)

    def views(x: Tensor) -> Tensor:
        x = rearrange(x, "b c (sy py) (sx px) -> b c sy py sx px", py=py, px=px)[:, :, :, rows][..., columns]
        return rearrange(x, "b c sy py sx px -> (b py px) c sy sx")

    return masked_mean(split_error_map(*map(views, images)), views(mask))


class LightFieldTask:
    """A light-field network on scenes of training_scenes.py; every SCENES_PER_VALIDATION-th scene validates."""

    def __init__(self, config: LightFieldTrainConfig, scenes: list[Scene], device: torch.device) -> None:
        torch.manual_seed(config.seed)
        self.config, self.device = config, device
        self.validation = scenes[::SCENES_PER_VALIDATION]
        self.training = [scene for index, scene in enumerate(scenes) if index % SCENES_PER_VALIDATION]
        self._groups = _by_shape(self.training)
        self._digest = digest(scenes)
        self.network = LightFieldNet(config.architecture).to(device)
        self.average = copy.deepcopy(self.network).requires_grad_(False)
        self._optimizer = torch.optim.AdamW(self.network.parameters(), config.rate, weight_decay=1e-4)
        self._epoch, self._rng = 0, np.random.default_rng(config.seed)

    @property
    def finished(self) -> LightFieldNet:
        """The network to save when the run has ended: the moving average."""
        return self.average

    @property
    def options(self) -> dict[str, Any]:
        """Hyper-parameters for the header of the weights."""
        return self.config.options()

    def data(self) -> dict[str, Any]:
        """Scenes of the run, for the provenance."""
        settings = Path(self.config.scenes, SCENE_SETTINGS)
        known = read_json(settings, "settings of training scenes") if settings.exists() else None
        return {"scenes": len(self.training) + len(self.validation), "sha256": self._digest, "settings": known,
                "validation": [scene.name for scene in self.validation]}

    def yardstick(self) -> dict[str, float]:
        """No further metrics: ``validate`` measures OIDN as well."""
        return {}

    def identity(self) -> dict[str, Any]:
        """Settings and data that a checkpoint belongs to."""
        return {**dataclasses.asdict(self.config), "scenes": self._digest}

    def begin(self, epoch: int) -> int:
        """Number of batches in an epoch."""
        self._epoch = epoch
        return self.config.steps_per_epoch

    def step(self, index: int) -> dict[str, Tensor]:
        """Do one update on a random batch that depends on the numbers of epoch and step alone."""
        self._rng = np.random.default_rng((self.config.seed, self._epoch, index))
        torch.manual_seed(int(self._rng.integers(2**63)))
        self._set_rate(self._epoch * self.config.steps_per_epoch + index)
        batch = self.draw()
        if self.config.clean_inputs:
            low = to_eis(torch.nn.functional.avg_pool2d(batch.halves.mean(1), self.config.scale), batch.lenses)
            batch.layers |= {"color": low, "oidn": low}
        terms = loss_terms(self.run(self.network, batch), batch)
        loss = terms["eia"] + VIEW_WEIGHT * terms["views"] + PIXEL_WEIGHT * terms["pixel"]
        # Errors shrink with the samples, but all sample counts should weigh alike.
        loss = loss * batch.samples**SAMPLE_WEIGHT
        self._optimizer.zero_grad(set_to_none=True)
        loss.backward()
        if torch.isfinite(torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)):
            self._optimizer.step()
        self._follow(self._epoch * self.config.steps_per_epoch + index)
        return {name: value.detach() for name, value in terms.items()}

    def draw(self) -> Batch:
        """Random augmented batch of equal-shaped scenes at one sample count."""
        sizes = np.array([len(group) for group in self._groups], float)
        group = self._groups[self._rng.choice(len(self._groups), p=sizes / sizes.sum())]
        chosen = [group[i] for i in self._rng.integers(len(group), size=self.config.batch)]
        return make_batch(chosen, int(self._rng.choice(sorted(chosen[0].low))), self.device, self._rng)

    def run(self, network: LightFieldNet, batch: Batch) -> Tensor:
        """Upscaled output for a batch, (N, 3, s·h, s·w) in the working domain."""
        features, base = network_inputs(batch.layers, batch.samples, self.config.architecture)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda"):
            clean = network(features, base)
        # The last steps stay in single precision: eight bits of mantissa would show in smooth gradients.
        clean = conserve(clean.float(), batch.layers["color"].mean((2, 3), keepdim=True))
        return upscale(clean, self.config.scale)

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean losses over validation scenes at each sample count, of the network and of OIDN alone."""
        sums: dict[str, list[float]] = defaultdict(list)
        for scene in self.validation:
            for samples in sorted(scene.low):
                batch = make_batch([scene], samples, self.device)
                outputs = {self.config.network: self.run(self.average, batch),
                           "oidn": upscale(encode(batch.layers["oidn"]), self.config.scale)}
                for name, output in outputs.items():
                    for term, value in loss_terms(output, batch).items():
                        sums[f"{name}.{term}_{samples}"].append(value.item())
        return {name: round(float(np.mean(values)), 5) for name, values in sums.items()}

    def state(self) -> dict[str, Any]:
        """Content of a checkpoint."""
        return {"network": self.network.state_dict(), "average": self.average.state_dict(),
                "optimizer": self._optimizer.state_dict()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from ``state``."""
        self.network.load_state_dict(state["network"])
        self.average.load_state_dict(state["average"])
        self._optimizer.load_state_dict(state["optimizer"])

    def _set_rate(self, step: int) -> None:
        """Linear warm-up, then a cosine to MIN_RATE of the full rate."""
        total = self.config.epochs * self.config.steps_per_epoch
        warm = min(1.0, (step + 1) / min(WARM_UP_STEPS, 1 + total // 10))
        cosine = MIN_RATE + (1 - MIN_RATE) * (1 + math.cos(math.pi * step / total)) / 2
        for group in self._optimizer.param_groups:
            group["lr"] = self.config.rate * warm * cosine

    def _follow(self, step: int) -> None:
        decay = min(EMA_DECAY, (step + 1) / (step + 10))
        torch._foreach_lerp_(list(self.average.parameters()), list(self.network.parameters()), 1 - decay)


def digest(scenes: list[Scene]) -> str:
    """SHA-256 over names and reference pixels of the scenes."""
    state = hashlib.sha256()
    for scene in scenes:
        state.update(scene.name.encode() + scene.halves[:, :, ::7, ::7].contiguous().numpy().tobytes())
    return state.hexdigest()


def _by_shape(scenes: list[Scene]) -> list[list[Scene]]:
    groups: dict[Any, list[Scene]] = defaultdict(list)
    for scene in scenes:
        groups[scene.lenses, tuple(scene.halves.shape), tuple(scene.low)].append(scene)
    return list(groups.values())
