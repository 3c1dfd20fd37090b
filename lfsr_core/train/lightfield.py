"""Training of our network on rendered light fields: `lfsr train` with a light-field config."""

from __future__ import annotations

import argparse
import copy
import dataclasses
import json
import math
import time
import tomllib
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, write_json
from lfsr_core.networks.lightfield import LightFieldConfig, LightFieldNet, encode
from lfsr_core.train.lightfield_data import Batch, Scene, from_eis, load_scenes, make_batch, network_inputs, to_eis
from lfsr_core.train.split_ssim import masked_mean, split_squared_error, split_ssim_map

EMA_DECAY = 0.998
VALIDATION_SHARE = 12
WARM_UP_STEPS = 200


@dataclasses.dataclass(frozen=True)
class TrainConfig:
    """One training run. The learning rate follows a cosine over ``steps`` or ``minutes``, whichever ends first."""

    name: str
    network: LightFieldConfig
    steps: int = 1_000_000
    minutes: float = 60.0
    batch: int = 4
    learning_rate: float = 2e-3
    view_weight: float = 0.5
    pixel_weight: float = 1.0
    clean_inputs: bool = False
    seed: int = 0


def read_config(path: str | Path) -> TrainConfig:
    """Config from TOML; LfsrError names an unknown entry."""
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        network = {key: tuple(value) if isinstance(value, list) else value
                   for key, value in data.pop("network", {}).items()}
        return TrainConfig(network=LightFieldConfig(**network), **data)
    except (OSError, tomllib.TOMLDecodeError, TypeError) as error:
        raise LfsrError(f"training config {path} cannot be used ({error}): correct that entry") from None


def loss_terms(output: Tensor, batch: Batch) -> dict[str, Tensor]:
    """Losses of network output (N, 3, H', W') over foreground EIs, in display values.

    ``eia`` and ``views``: 1 - split SSIM; ``pixel``: L1 to the halves' mean;
    ``error``: split squared error, reported only.
    """
    raw = from_eis(output.float(), batch.lenses)
    image, halves = raw.clamp(0, 1), encode(batch.halves)
    a, b = halves[:, 0].clamp(0, 1), halves[:, 1].clamp(0, 1)
    mask = foreground(batch, raw.shape)
    pixel = (raw - halves.mean(1)).abs().clamp_max(1)
    return {"eia": 1 - masked_mean(split_ssim_map(image, a, b), mask),
            "views": 1 - _view_ssim(image, a, b, mask, batch.lenses),
            "pixel": masked_mean(pixel, mask), "error": masked_mean(split_squared_error(image, a, b), mask)}


def foreground(batch: Batch, shape: torch.Size) -> Tensor:
    """(B, 1, H, W) mask of EIs that any ray of the low-resolution render hit."""
    hit = batch.layers["alpha"].amax((1, 2, 3), keepdim=True) > 0
    sx, sy = batch.lenses
    size = (shape[-2] // sy, shape[-1] // sx)
    return from_eis(hit.float().expand(-1, 1, *size), batch.lenses)


def _view_ssim(image: Tensor, a: Tensor, b: Tensor, mask: Tensor, lenses: tuple[int, int], stride: int = 3) -> Tensor:
    """Mean split SSIM of every ``stride``-th decoded view: small pictures, one pixel per lens."""
    px, py = image.shape[-1] // lenses[0], image.shape[-2] // lenses[1]
    rows = torch.arange(torch.randint(stride, ()).item(), py, stride)
    columns = torch.arange(torch.randint(stride, ()).item(), px, stride)

    def views(x: Tensor) -> Tensor:
        x = x.view(x.shape[0], x.shape[1], lenses[1], py, lenses[0], px)[:, :, :, rows][..., columns]
        return x.permute(0, 3, 5, 1, 2, 4).reshape(-1, x.shape[1], lenses[1], lenses[0])

    return masked_mean(split_ssim_map(views(image), views(a), views(b)), views(mask))


def _clean(batch: Batch, scale: int) -> Batch:
    """The ablation: low resolution by downsampling the reference instead of rendering."""
    mean = batch.halves.mean(1)
    low = torch.nn.functional.avg_pool2d(mean, scale)
    color = to_eis(low, batch.lenses)
    return dataclasses.replace(batch, layers=batch.layers | {"color": color, "oidn": color})


class Trainer:
    """State of one run: everything a checkpoint holds."""

    def __init__(self, config: TrainConfig, scenes: list[Scene], device: str) -> None:
        torch.manual_seed(config.seed)
        self.config, self.device = config, device
        self.rng = np.random.default_rng(config.seed)
        self.validation = scenes[::VALIDATION_SHARE]
        self.groups = _by_shape([scene for index, scene in enumerate(scenes) if index % VALIDATION_SHARE])
        self.net = LightFieldNet(config.network).to(device)
        self.ema = copy.deepcopy(self.net).requires_grad_(False)
        self.optimizer = torch.optim.AdamW(self.net.parameters(), config.learning_rate, weight_decay=1e-4)
        self.step, self.seconds, self.log = 0, 0.0, []

    def progress(self) -> float:
        """Share of the run that is done."""
        return max(self.step / self.config.steps, self.seconds / (60 * self.config.minutes))

    def draw(self) -> Batch:
        """Random augmented batch of equal-shaped scenes at one sample count."""
        sizes = np.array([len(group) for group in self.groups], float)
        group = self.groups[self.rng.choice(len(self.groups), p=sizes / sizes.sum())]
        chosen = [group[i] for i in self.rng.integers(len(group), size=self.config.batch)]
        return make_batch(chosen, int(self.rng.choice(sorted(chosen[0].low))), self.rng)

    def train_step(self) -> float:
        """One update; returns the loss."""
        warm = min(1.0, (self.step + 1) / min(WARM_UP_STEPS, 1 + self.config.steps // 10))
        done = self.progress()
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate * warm * (0.01 + 0.495 * (1 + math.cos(math.pi * min(1, done))))
        batch = self.draw()
        if self.config.clean_inputs:
            batch = _clean(batch, self.config.network.scale)
        terms = loss_terms(self.run(self.net, batch), batch)
        loss = terms["eia"] + self.config.view_weight * terms["views"] + self.config.pixel_weight * terms["pixel"]
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        if torch.isfinite(norm):
            self.optimizer.step()
        decay = min(EMA_DECAY, (self.step + 1) / (self.step + 10))
        torch._foreach_lerp_(list(self.ema.parameters()), list(self.net.parameters()), 1 - decay)
        self.step += 1
        return loss

    def run(self, net: LightFieldNet, batch: Batch) -> Tensor:
        """Network output for a batch, (N, 3, s·h, s·w) in the working domain."""
        features, base = network_inputs(batch.layers, batch.samples, self.config.network)
        with torch.autocast(self.device.split(":")[0], torch.bfloat16, enabled=self.device.startswith("cuda")):
            clean, hidden = net.denoise(features, base, batch.lenses)
        # Eight bits of mantissa would show in smooth gradients: the last step stays in single precision.
        return net.upscale(clean.float(), hidden.float())

    @torch.no_grad()
    def validate(self) -> dict[str, dict[str, float]]:
        """Mean split metrics over validation scenes, for the network and for OIDN + bicubic, per sample count."""
        sums: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
        plain = LightFieldNet(dataclasses.replace(self.config.network, base="oidn")).to(self.device)
        for scene in self.validation:
            for samples in sorted(scene.low):
                batch = make_batch([scene], samples)
                rival = plain.upscale(encode(batch.layers["oidn"]), None) if plain.detail is None else None
                outputs = {"net": self.run(self.ema, batch), "oidn+bicubic": rival}
                for name, output in outputs.items():
                    if output is not None:
                        terms = loss_terms(output, batch)
                        sums[name][f"ssim_eia_{samples}"].append(1 - terms["eia"].item())
                        sums[name][f"ssim_views_{samples}"].append(1 - terms["views"].item())
                        sums[name][f"mse_{samples}"].append(terms["error"].item())
        return {name: {key: round(float(np.mean(values)), 5) for key, values in row.items()}
                for name, row in sums.items()}

    def save(self, path: Path) -> None:
        """Checkpoint that ``load`` resumes from."""
        state = {"net": self.net.state_dict(), "ema": self.ema.state_dict(), "optimizer": self.optimizer.state_dict(),
                 "step": self.step, "seconds": self.seconds, "log": json.dumps(self.log),
                 "rng": json.dumps(self.rng.bit_generator.state)}
        with atomic_path(path) as temporary:
            torch.save(state, temporary)

    def load(self, path: Path) -> None:
        """Resume from a checkpoint of the same config."""
        state = torch.load(path, map_location=self.device, weights_only=True)
        self.net.load_state_dict(state["net"])
        self.ema.load_state_dict(state["ema"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.step, self.seconds, self.log = state["step"], state["seconds"], json.loads(state["log"])
        self.rng.bit_generator.state = json.loads(state["rng"])


def _by_shape(scenes: list[Scene]) -> list[list[Scene]]:
    groups: dict[Any, list[Scene]] = defaultdict(list)
    for scene in scenes:
        groups[scene.lenses, tuple(scene.halves.shape), tuple(scene.low)].append(scene)
    return list(groups.values())


def train(config: TrainConfig, scenes: list[Scene], output: Path, device: str, resume: bool = False) -> Trainer:
    """Run to the end of the schedule, checkpointing each minute; log in ``train.jsonl``."""
    trainer, checkpoint = Trainer(config, scenes, device), output / f"{config.name}.ckpt"
    if resume and checkpoint.exists():
        trainer.load(checkpoint)
    last, running, saved = time.perf_counter(), [], time.perf_counter()
    while trainer.progress() < 1:
        running.append(trainer.train_step())
        if trainer.step % 100 == 0:
            loss, running = float(torch.stack([x.detach() for x in running]).mean()), []
            now = time.perf_counter()
            trainer.seconds, last = trainer.seconds + now - last, now
            trainer.log.append({"step": trainer.step, "seconds": round(trainer.seconds, 1), "loss": round(loss, 5)})
            print(json.dumps({"name": config.name, **trainer.log[-1]}), flush=True)
            if now - saved > 60:
                trainer.save(checkpoint)
                saved = now
    trainer.save(checkpoint)
    return trainer


def main() -> None:
    """`python -m lfsr_core.train.lightfield CONFIG… --data DIR --output DIR`."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("configs", nargs="+")
    parser.add_argument("--data", required=True)
    parser.add_argument("--output", required=True, type=Path)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--resume", action="store_true")
    options = parser.parse_args()
    scenes = load_scenes(options.data, options.device)
    for path in options.configs:
        config = read_config(path)
        if options.minutes:
            config = dataclasses.replace(config, minutes=options.minutes)
        trainer = train(config, scenes, options.output, options.device, options.resume)
        report = {"config": dataclasses.asdict(config), "steps": trainer.step, "seconds": trainer.seconds,
                  "validation": trainer.validate(), "validation_scenes": [s.name for s in trainer.validation],
                  "training_scenes": sum(map(len, trainer.groups)), "log": trainer.log}
        write_json(options.output / f"{config.name}.json", report)
        print(json.dumps({"name": config.name, "steps": trainer.step, **report["validation"]}), flush=True)


if __name__ == "__main__":
    main()
