"""Which weights a network runs with, how they were trained, and training of those that are missing."""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, read_json, write_json
from lfsr_core.progress import ProgressBar
from lfsr_core.reconstruct import registry
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.networks import catalogue
from lfsr_lab.experiments.paper.settings import Settings
from lfsr_lab.train.config import builtin_configs, from_values, load_config

if TYPE_CHECKING:
    from torch import nn

    from lfsr_lab.train.config import TrainConfig

SHORT_CONFIG = "paper-short"
CONFIG_FILE = "plan.json"  # of a short run, so that it is the same when it is resumed
ADVERSARIAL = 1e-3
FEWEST_EPOCHS, MOST_CROPS, TRIAL_STEPS = 10, 16, 3
# What makes a schedule the paper's own; files and intervals of logging do not.
RECIPE = ("scale", "crop", "crops_per_photograph", "downsample", "linear_light", "augment", "epochs", "batch", "rate",
          "schedule", "adversarial")


def weights(settings: Settings, name: str) -> Path | None:
    """Weights of a network at the settings' scale, None if there are none.

    Those given, else those trained in this output folder (now, if minutes were
    granted and no folder was given), else those that ship. Ours ship: photographs
    do not train them.
    """
    for folder in filter(None, (settings.weights, trained_folder(settings))):
        path = catalogue.weights_path(name, settings.scale, folder)
        if path.exists():
            return path
    if settings.train_minutes > 0 and not catalogue.spec(name).light_field:
        return train(settings, catalogue.spec(name).weights or name)
    path = catalogue.weights_path(name, settings.scale)
    return path if path.exists() else None


def trained_folder(settings: Settings) -> Path:
    """Where this run's own weights go; another number of minutes is another schedule."""
    return settings.output / f"weights-{settings.train_minutes:g}min"


def schedule(path: Path | None) -> str:
    """How weights were trained, in one phrase, from the file beside them."""
    if path is None:
        return "no weights"
    facts = _provenance(path)
    config, took = facts.get("config", {}), f"{facts.get('seconds', 0.0):.0f} s on {facts.get('device')}"
    if "steps_per_epoch" in config:
        return f"on rendered light fields: {config['epochs']} epochs of {config['steps_per_epoch']} batches, {took}"
    if not {"epochs", "crop", "rate", "schedule"} <= config.keys():
        return "schedule not recorded"
    kind = "the paper's recipe" if _is_full(config) else "short schedule"
    kind += ", begun from the generator trained without it" if config.get("start") else ""
    return (f"{kind}: {config['epochs']} epochs of {config['crops_per_photograph']} {config['crop']}-pixel crops per "
            f"photograph, rate {config['rate']:g} {config['schedule']}, {took}")


def _provenance(path: Path) -> dict[str, Any]:
    return read_json(path.with_suffix(".json"), "the provenance beside the weights")


def fingerprint(path: Path | None) -> str | None:
    """The weights' own hash, so that a measurement with others is made again."""
    return _provenance(path).get("sha256") if path else None


def fingerprints(settings: Settings, name: str) -> dict[str, str | None]:
    """Hash of the weights of each network of a method."""
    return {network: fingerprint(weights(settings, network)) for network in MethodName.parse(name).networks}


def method(settings: Settings, name: str) -> registry.Method | None:
    """Method of a name, its network with the weights chosen here; None where these are missing."""
    parsed = MethodName.parse(name)
    if not parsed.network:
        return registry.method(parsed)
    path = weights(settings, parsed.upscaler)
    if path is None:
        return None
    device = {} if parsed.network.light_field else {"device": settings.device}
    return registry.method(parsed, upscaler=catalogue.upscaler(parsed.upscaler, weights=path, **device))


def untrained(name: str, scale: int) -> nn.Module:
    """The network as built, with random weights of seed 0: its speed does not depend on them."""
    import torch

    from lfsr_lab.networks.networks import build

    torch.manual_seed(0)
    return build(name, scale).eval().requires_grad_(False)


def untrained_method(settings: Settings, name: str, scale: int) -> registry.Method:
    """The method for timing at any scale, its network with random weights."""
    if not MethodName.parse(name).networks:
        return registry.method(name)
    from lfsr_lab.networks import checkpoint as files

    path = catalogue.weights_path(name, scale, settings.output / "untrained")
    if not path.exists():
        files.save(path, untrained(name, scale), scale, {"untrained": True}, catalogue.spec(name).options)
    return registry.method(name, upscaler=catalogue.upscaler(name, weights=path, device=settings.device))


def train(settings: Settings, name: str) -> Path:
    """Train a network for about the granted minutes; a stopped run goes on where it was.

    LfsrError where photographs are missing; KeyboardInterrupt if it is stopped.
    """
    from lfsr_lab.train import loop, session

    folder = trained_folder(settings) / "runs" / f"{name}-x{settings.scale}"
    config = _short_config(settings, name, folder / CONFIG_FILE)
    print(f"train   {name} x{settings.scale}: {config.epochs} epochs", file=sys.stderr, flush=True)
    with contextlib.closing(ProgressBar()) as bar:
        options = loop.RunOptions(resume=(folder / loop.CHECKPOINT).exists(), progress=bar)
        trained = session.train(config, folder, settings.device, options)
    if trained.weights is None:
        raise KeyboardInterrupt
    return _published(trained.weights, trained_folder(settings))


def _published(weights_file: Path, folder: Path) -> Path:
    """Provenance first: weights that exist are complete."""
    for suffix in (".json", ".safetensors"):
        with atomic_path(folder / f"{weights_file.stem}{suffix}") as temporary:
            shutil.copy(weights_file.with_suffix(suffix), temporary)
    return folder / weights_file.name


def _short_config(settings: Settings, name: str, kept: Path) -> TrainConfig:
    """Config of a short run that takes about the granted minutes; the one that is kept where it is resumed."""
    if kept.exists():
        return from_values(read_json(kept, "the config of a training run"), str(kept))
    changes = {"network": name, "scale": settings.scale, "adversarial": ADVERSARIAL if name.endswith("-gan") else 0.0,
               "validate_every": 1000000, "photographs": settings.photographs, "validation": settings.validation,
               "start": _start(settings, name)}
    config = load_config(SHORT_CONFIG, [f"{key}={value}" for key, value in changes.items() if value != ""])
    seconds, photographs = _seconds_per_step(settings, config)
    config = fitted(config, 60 * settings.train_minutes / seconds, photographs)
    write_json(kept, dataclasses.asdict(config))
    return config


def _start(settings: Settings, name: str) -> str:
    """Weights that a short run begins with: an adversary meets a generator that is trained, for want of days."""
    generator = name.removesuffix("-gan")
    return "" if generator == name else str(weights(settings, generator).resolve())


def fitted(config: TrainConfig, steps: float, photographs: int) -> TrainConfig:
    """Config whose epochs take ``steps`` batches in all: fewer crops per photograph rather than under ten epochs."""
    crops = int(steps * config.batch / (FEWEST_EPOCHS * photographs))
    crops = min(max(crops, 1), MOST_CROPS)
    per_epoch = max(1, photographs * crops // config.batch)
    return dataclasses.replace(config, crops_per_photograph=crops, epochs=max(1, int(steps / per_epoch)))


def _seconds_per_step(settings: Settings, config: TrainConfig) -> tuple[float, int]:
    """Seconds of one batch on this device, and the number of photographs."""
    from lfsr_lab.networks.engine import choose_device
    from lfsr_lab.train.photographs.data import load_photographs
    from lfsr_lab.train.photographs.task import ComparatorTask
    from lfsr_lab.train.session import LONG_SIDE

    photographs = load_photographs(config.photographs, LONG_SIDE)
    task = ComparatorTask(config, photographs, None, choose_device(settings.device))
    if task.begin(0) < 1:
        raise LfsrError(f"{config.photographs} holds too few photographs for a batch of {config.batch}: give more")
    losses = [task.step(0)]
    started = time.monotonic()
    for _ in range(TRIAL_STEPS):
        losses.append(task.step(0))
    # Reading a loss waits for a GPU's work.
    float(losses[-1]["mse"])
    return (time.monotonic() - started) / TRIAL_STEPS, len(photographs.names)


def _is_full(config: dict[str, Any]) -> bool:
    """True if the recipe is that of the network's built-in config."""
    name = config["network"]
    if name not in builtin_configs():
        return False
    recipe = dataclasses.asdict(load_config(name, [f"scale={config.get('scale', 4)}"]))
    return all(config.get(key) == recipe[key] for key in RECIPE)
