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
from lfsr_lab.networks.denoiser import Denoiser, hdr_decode, hdr_encode, stock_weights
from lfsr_lab.networks.tza import BASE, SMALL, read_tza
from lfsr_lab.train.config import DenoiserConfig
from lfsr_lab.train.denoiser.data import Crop, Scene, crop

SLOPE = 1.055 / 2.4  # of the sRGB curve at 1, where the logarithm goes on
ENCODED_WEIGHT = 0.5  # of the error that the network sees
LEAST_SHOWN = 0.02  # fraction of a crop
ENLARGED = 2  # times, before structure is compared
NEAR_SIGMA = 0.7  # pixels, where elemental images cannot be enlarged
TRUNCATED = 3  # standard deviations of a window


def losses(output: Tensor, crop: Crop) -> tuple[Tensor, Tensor]:
    """Return the mean absolute error and 1 - SSIM of display values where anything shows.

    ``output``: what the network makes of ``crop.inputs``, (1, 3, H, W).
    """
    made = output[(..., *crop.inside)]
    image, target = displayed(hdr_decode(made)), displayed(crop.target)
    weight = crop.shown / crop.shown.mean().clamp(min=LEAST_SHOWN)
    error = ((image - target).abs() * weight).mean()
    error = error + ENCODED_WEIGHT * ((made - hdr_encode(crop.target)).abs() * weight).mean()
    if crop.is_tiled:
        return error, _structure_of_eis(image, target, crop)
    row, column = (window(length, NEAR_SIGMA) for length in image.shape[2:])
    return error, ((1 - _ssim(image.clamp(0, 1), target.clamp(0, 1), row, column)) * weight).mean()


def displayed(linear: Tensor) -> Tensor:
    """sRGB values of scene-linear ones; logarithmic above 1, so that highlights count for every view transform."""
    low = linear.clamp(max=1)
    curve = torch.where(low <= 0.0031308, 12.92 * low, 1.055 * low.clamp(min=1e-8) ** (1 / 2.4) - 0.055)
    return curve + SLOPE * torch.log(linear.clamp(min=1))


def _structure_of_eis(image: Tensor, target: Tensor, crop: Crop) -> Tensor:
    """1 - SSIM of enlarged elemental images, each on its own, with a window as large as that of a finished EIA."""
    shown = _elemental_images(crop.shown, crop.ei).amax((1, 2, 3)) > 0
    if not shown.any():
        return image.sum() * 0
    images = _enlarged(_elemental_images(image, crop.ei)[shown], "bilinear").clamp(0, 1)
    with torch.no_grad():
        targets = _enlarged(_elemental_images(target, crop.ei)[shown], "bicubic").clamp(0, 1)
    sigma = ENLARGED * SSIM_SIGMA / crop.scale
    row, column = (window(length * ENLARGED, sigma) for length in crop.ei)
    return (1 - _ssim(images, targets, row, column)).mean()


def _elemental_images(image: Tensor, ei: tuple[int, int]) -> Tensor:
    """(1, C, H, W) -> (N, C, h, w)."""
    (h, w), (_, channels, height, width) = ei, image.shape
    tiles = image.reshape(channels, height // h, h, width // w, w)
    return tiles.permute(1, 3, 0, 2, 4).reshape(-1, channels, h, w)


def _enlarged(images: Tensor, mode: str) -> Tensor:
    return functional.interpolate(images, scale_factor=ENLARGED, mode=mode, align_corners=False)


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
    mean_x, mean_y, xx, yy, xy = (row.T @ maps @ column).chunk(5, 1)
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

    def __init__(self, config: DenoiserConfig, scenes: list[Scene]) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.scenes = [scene for scene in scenes if not scene.validates]
        self.validating = [scene for scene in scenes if scene.validates][:MOST_VALIDATING]
        self.network = begin(config).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.average = {name: value.clone() for name, value in self.network.state_dict().items()}
        self.optimiser = torch.optim.Adam(self.network.parameters(), config.rate)
        self.levels: dict[int, float] = {}  # running mean of the loss by samples
        self.epoch = self.taken = 0  # the epoch, and steps since the start

    def identity(self) -> dict[str, Any]:
        return {"config": dataclasses.asdict(self.config), "data": self.data()}

    def data(self) -> dict[str, Any]:
        """Number of scenes and the digest of their targets."""
        digest = hashlib.sha256()
        for scene in (*self.scenes, *self.validating):
            digest.update(scene.layers["color_target"].tobytes())
        return {"scenes": len(self.scenes), "validating": len(self.validating), "sha256": digest.hexdigest()}

    def begin(self, epoch: int) -> int:
        """Prepare an epoch; return its number of steps."""
        self.epoch = epoch
        return self.config.steps_per_epoch

    def step(self, index: int) -> dict[str, Tensor]:
        """Train on one crop of one scene."""
        rng = np.random.default_rng([self.config.seed, self.epoch, index])
        scene = self.scenes[rng.integers(len(self.scenes))]
        samples = int(rng.choice(list(SAMPLES), p=list(SAMPLES.values())))
        part = crop(scene, samples, rng, self.config.side, mirror=self.config.mirror)
        with torch.autocast("cpu", torch.bfloat16, enabled=self.config.half_precision):
            output = self.network(part.inputs)
        error, structure = losses(output.float(), part)
        loss = self.config.error_weight * error + structure
        # Weighed so that all counts of samples matter nearly alike.
        before = self.levels.get(samples, loss.item())
        self.levels[samples] = REMEMBERED * before + (1 - REMEMBERED) * loss.item()
        loss = loss * (float(np.mean(list(self.levels.values()))) / self.levels[samples]) ** BALANCE
        self.optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
        for group in self.optimiser.param_groups:
            group["lr"] = rate(self.config, self.taken)
        self.optimiser.step()
        self.taken += 1
        keep = min(AVERAGED, self.taken / (self.taken + 19))
        with torch.no_grad():
            for name, value in self.network.state_dict().items():
                self.average[name].lerp_(value, 1 - keep)
        return {"error": error.detach(), "structure": structure.detach()}

    @property
    def finished(self) -> Denoiser:
        """The network with the running mean of its weights."""
        network = Denoiser(self.network.widths, self.network.inputs)
        network.load_state_dict(self.average)
        return network

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean SSIM of fixed crops of scenes that nothing is trained on, by samples."""
        network, result = self.finished, {}
        for samples in VALIDATED:
            parts = [crop(scene, samples, np.random.default_rng(1), VALIDATED_SIDE, mirror=self.config.mirror,
                          augment=False) for scene in self.validating]
            structure = [losses(network(part.inputs), part)[1].item() for part in parts]
            result[f"validation.ssim_{samples}"] = 1 - float(np.mean(structure))
        return result

    def state(self) -> dict[str, Any]:
        return {"network": self.network.state_dict(), "average": self.average, "levels": self.levels,
                "optimiser": self.optimiser.state_dict(), "taken": self.taken}

    def restore(self, state: dict[str, Any]) -> None:
        self.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.average, self.levels, self.taken = state["average"], state["levels"], state["taken"]


def begin(config: DenoiserConfig) -> Denoiser:
    """Return the network to start from."""
    if config.start == "stock":
        tensors = stock_weights("hdr-guided" if config.guides else "hdr", config.size)
        return Denoiser.from_tensors(tensors, config.inputs)
    if config.start:
        return Denoiser.from_tensors(read_tza(config.start), config.inputs)
    return Denoiser(WIDTHS[config.size], config.inputs)


def rate(config: DenoiserConfig, step: int) -> float:
    """Adam's rate: a short warm-up, then a cosine."""
    course = step / (config.epochs * config.steps_per_epoch)
    cosine = LEAST_RATE + (1 - LEAST_RATE) * (1 + math.cos(math.pi * course)) / 2
    return config.rate * min(1.0, (step + 1) / WARM_UP) * cosine
