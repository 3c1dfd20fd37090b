"""Task of the training loop: the denoiser that Open Image Denoise runs, on low-resolution training scenes."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import math
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from lfsr_core.metrics.eia_metrics import SSIM_C1, SSIM_C2, SSIM_SIGMA
from lfsr_core.reconstruct.methods.denoise import GUIDED_INPUTS
from lfsr_core.reconstruct.upscaler import kernel_matrix
from lfsr_lab.networks.denoiser import Denoiser, hdr_decode, hdr_encode, stock_weights
from lfsr_lab.networks.tza import BASE, SMALL, read_tza
from lfsr_lab.train.config import DenoiserConfig
from lfsr_lab.train.denoiser.data import Crops, Scene, crops

SLOPE = 1.055 / 2.4  # of the sRGB curve at 1, where the logarithm goes on
ENCODED_WEIGHT = 0.5  # of the error that the network sees
LEAST_SHOWN = 0.02  # fraction of a crop
ENLARGED = 2  # times, before structure is compared
NEAR_SIGMA = 0.7  # pixels, where elemental images cannot be enlarged
TRUNCATED = 3  # standard deviations of a window


def losses(output: Tensor, part: Crops) -> tuple[Tensor, Tensor]:
    """Return the mean absolute error and 1 - SSIM (B,) of display values where anything shows, of each crop.

    ``output``: what the network makes of ``part.inputs``, (B, 3, H, W).
    """
    made = output[(..., *part.inside)]
    image, target = displayed(hdr_decode(made)), displayed(part.target)
    weight = part.shown / part.shown.mean((1, 2, 3), keepdim=True).clamp(min=LEAST_SHOWN)
    differs = (image - target).abs() + ENCODED_WEIGHT * (made - hdr_encode(part.target)).abs()
    error = (differs * weight).mean((1, 2, 3))
    if part.is_tiled:
        return error, _structure_of_eis(image, target, part)
    row, column = (window(length, NEAR_SIGMA).to(image) for length in image.shape[2:])
    return error, ((1 - _ssim(image.clamp(0, 1), target.clamp(0, 1), row, column)) * weight).mean((1, 2, 3))


def displayed(linear: Tensor) -> Tensor:
    """sRGB values of scene-linear ones; logarithmic above 1, so that highlights count for every view transform."""
    low = linear.clamp(max=1)
    curve = torch.where(low <= 0.0031308, 12.92 * low, 1.055 * low.clamp(min=1e-8) ** (1 / 2.4) - 0.055)
    return curve + SLOPE * torch.log(linear.clamp(min=1))


def _structure_of_eis(image: Tensor, target: Tensor, part: Crops) -> Tensor:
    """1 - SSIM of enlarged elemental images, each on its own, with a window as large as that of a finished EIA."""
    shown = (_elemental_images(part.shown, part.ei).amax((2, 3, 4)) > 0).float()
    down, across = (torch.from_numpy(kernel_matrix("cubic", length, ENLARGED)).to(image) for length in part.ei)
    images, targets = ((down @ _elemental_images(values, part.ei).flatten(0, 1) @ across.T).clamp(0, 1)
                       for values in (image, target))
    row, column = (torch.stack([window(length * ENLARGED, ENLARGED * SSIM_SIGMA / scale) for scale in part.scales])
                   .to(image).repeat_interleave(shown.shape[1], 0)[:, None] for length in part.ei)
    dissimilarity = (1 - _ssim(images, targets, row, column)).mean((1, 2, 3)).unflatten(0, shown.shape)
    return (dissimilarity * shown).sum(1) / shown.sum(1).clamp(min=1)


def _elemental_images(image: Tensor, ei: tuple[int, int]) -> Tensor:
    """(B, C, H, W) -> (B, N, C, h, w)."""
    (h, w), (count, channels, height, width) = ei, image.shape
    tiles = image.reshape(count, channels, height // h, h, width // w, w)
    return tiles.permute(0, 2, 4, 1, 3, 5).reshape(count, -1, channels, h, w)


@functools.lru_cache(maxsize=256)
def window(length: int, sigma: float) -> Tensor:
    """(length, length) matrix whose columns are Gaussian windows, reflected at the ends."""
    reach = min(length - 1, max(1, round(TRUNCATED * sigma)))
    steps = np.arange(-reach, reach + 1)
    gauss = np.exp(-0.5 * (steps / sigma) ** 2)
    places = np.arange(length)[:, None] + steps
    places = np.where(places < 0, -places - 1, np.where(places >= length, 2 * length - 1 - places, places))
    matrix = np.zeros((length, length), np.float32)
    np.add.at(matrix, (places, np.arange(length)[:, None]), gauss / gauss.sum())
    return torch.from_numpy(matrix)


def _ssim(x: Tensor, y: Tensor, row: Tensor, column: Tensor) -> Tensor:
    """Local SSIM of (N, C, H, W); ``row``, ``column``: ``window`` of H and of W."""
    maps = torch.cat([x, y, x * x, y * y, x * y], 1)
    mean_x, mean_y, xx, yy, xy = (row.mT @ maps @ column).chunk(5, 1)
    variances = (xx - mean_x * mean_x).clamp(min=0) + (yy - mean_y * mean_y).clamp(min=0)
    light = (2 * mean_x * mean_y + SSIM_C1) / (mean_x * mean_x + mean_y * mean_y + SSIM_C1)
    return light * (2 * (xy - mean_x * mean_y) + SSIM_C2) / (variances + SSIM_C2)


WIDTHS = {"small": SMALL, "base": BASE}
# How often each count of samples is trained on.
SAMPLES = {1: 0.2, 2: 0.1, 4: 0.2, 8: 0.1, 16: 0.2, 32: 0.1, 64: 0.1}
VALIDATED = (1, 4, 16, 64)  # samples
MOST_VALIDATING, VALIDATED_SIDE = 24, 224  # scenes, pixels
BALANCE, REMEMBERED = 0.7, 0.98  # how far losses of few and many samples are made alike; of their running means
WARM_UP, LEAST_RATE = 100, 0.02  # steps; fraction of the rate at the end
AVERAGED = 0.9985  # of the running mean of weights, which is the result
LARGEST_GRADIENT = 1.0


class DenoiserTask:
    """Training of one denoiser; ``scenes``: those of ``load_scenes``."""

    def __init__(self, config: DenoiserConfig, scenes: list[Scene], device: torch.device) -> None:
        torch.manual_seed(config.seed)
        self.config, self.device = config, device
        # Read from the device's memory, which holds all of them.
        held = [dataclasses.replace(scene, layers=scene.layers.to(device)) for scene in scenes]
        self.scenes = [scene for scene in held if not scene.validates]
        self.validating = [scene for scene in held if scene.validates][:MOST_VALIDATING]
        self.alike = {scene.ei: [other for other in self.scenes if other.ei == scene.ei] for scene in self.scenes}
        self.network = begin(config).to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.average = {name: value.clone() for name, value in self.network.state_dict().items()}
        self.optimiser = torch.optim.Adam(self.network.parameters(), config.rate)
        self.levels = torch.zeros(len(SAMPLES), device=device)  # running mean of the loss by samples
        self.epoch = self.taken = 0  # the epoch, and steps since the start

    def identity(self) -> dict[str, Any]:
        return {"config": dataclasses.asdict(self.config), "data": self.data()}

    def data(self) -> dict[str, Any]:
        """Number of scenes and the digest of their layers."""
        digest = hashlib.sha256()
        for scene in (*self.scenes, *self.validating):
            digest.update(scene.layers.cpu().numpy().tobytes())
        return {"scenes": len(self.scenes), "validating": len(self.validating), "sha256": digest.hexdigest()}

    def begin(self, epoch: int) -> int:
        """Prepare an epoch; return its number of steps."""
        self.epoch = epoch
        return self.config.steps_per_epoch

    def step(self, index: int) -> dict[str, Tensor]:
        """Train on a batch of crops of scenes with elemental images of one size."""
        rng = np.random.default_rng([self.config.seed, self.epoch, index])
        alike = self.alike[self.scenes[rng.integers(len(self.scenes))].ei]
        scenes = [alike[place] for place in rng.integers(len(alike), size=self.config.batch)]
        levels = rng.choice(len(SAMPLES), len(scenes), p=list(SAMPLES.values()))
        part = crops(scenes, [list(SAMPLES)[level] for level in levels], rng, self.config.side, self.device)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type != "cpu"):
            output = self.network(part.inputs.contiguous(memory_format=torch.channels_last))
        error, structure = losses(output.float(), part)
        loss = self.config.error_weight * error + structure
        # Weighed so that all counts of samples matter nearly alike.
        with torch.no_grad():
            chosen = functional.one_hot(torch.as_tensor(levels, device=self.device), len(SAMPLES)).float()
            present = chosen.sum(0)
            means = loss @ chosen / present.clamp(min=1)
            before = torch.where(self.levels > 0, self.levels, means)
            self.levels = torch.where(present > 0, REMEMBERED * before + (1 - REMEMBERED) * means, before)
            weights = chosen @ (self.levels.sum() / (self.levels > 0).sum() / self.levels.clamp(min=1e-6)) ** BALANCE
        self.optimiser.zero_grad()
        (loss * weights).mean().backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
        for group in self.optimiser.param_groups:
            group["lr"] = rate(self.config, self.taken)
        self.optimiser.step()
        self.taken += 1
        keep = min(AVERAGED, self.taken / (self.taken + 19))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.average.values()), list(self.network.state_dict().values()), 1 - keep)
        return {"error": error.detach().mean(), "structure": structure.detach().mean()}

    @property
    def finished(self) -> Denoiser:
        """The network with the running mean of its weights."""
        network = Denoiser(self.network.widths, self.network.inputs).to(self.device)
        network.load_state_dict(self.average)
        return network

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean SSIM of fixed crops of scenes that nothing is trained on, by samples."""
        network, result = self.finished, {}
        for samples in VALIDATED:
            parts = [crops([scene], [samples], np.random.default_rng(1), VALIDATED_SIDE, self.device, augment=False)
                     for scene in self.validating]
            structure = [losses(network(part.inputs), part)[1].item() for part in parts]
            result[f"validation.ssim_{samples}"] = 1 - float(np.mean(structure))
        return result

    def state(self) -> dict[str, Any]:
        return {"network": self.network.state_dict(), "average": self.average, "levels": self.levels,
                "optimiser": self.optimiser.state_dict(), "taken": self.taken}

    def restore(self, state: dict[str, Any]) -> None:
        self.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.average = {name: value.to(self.device) for name, value in state["average"].items()}
        self.levels, self.taken = state["levels"].to(self.device), state["taken"]


def begin(config: DenoiserConfig) -> Denoiser:
    """Return the network to start from."""
    if config.start:
        tensors = stock_weights("hdr-guided", config.size) if config.start == "stock" else read_tza(config.start)
        return Denoiser.from_tensors(tensors, GUIDED_INPUTS)
    return Denoiser(WIDTHS[config.size], GUIDED_INPUTS)


def rate(config: DenoiserConfig, step: int) -> float:
    """Adam's rate: a short warm-up, then a cosine."""
    course = step / (config.epochs * config.steps_per_epoch)
    cosine = LEAST_RATE + (1 - LEAST_RATE) * (1 + math.cos(math.pi * course)) / 2
    return config.rate * min(1.0, (step + 1) / WARM_UP) * cosine
