"""Which weights a network runs with, how they were trained, and training of those that are missing."""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.files import atomic_path, read_json
from lfsr_core.progress import ProgressBar
from lfsr_core.reconstruct import registry
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.networks import catalogue
from lfsr_lab.experiments.engine.cells import to_stderr
from lfsr_lab.experiments.paper.settings import Settings
from lfsr_lab.train.config import builtin_configs, load_config

if TYPE_CHECKING:
    from torch import nn
SHORT_CONFIG = "paper-short"
ADVERSARIAL = 1e-3
# What makes a schedule the paper's own; files and intervals of logging do not.
RECIPE = ("scale", "crop", "crops_per_photograph", "downsample", "linear_light", "augment", "epochs", "batch", "rate",
          "schedule", "adversarial")


def weights(settings: Settings, name: str) -> Path | None:
    """Weights of a network at the settings' scale, None if there are none.

    Those given, else those trained in this output folder (now, if epochs were granted), else those that ship. Ours
    ship: photographs do not train them.
    """
    for folder in filter(None, (settings.weights, trained_folder(settings))):
        path = catalogue.weights_path(name, settings.scale, folder)
        if path.exists():
            return path
    if settings.train_epochs > 0 and not catalogue.spec(name).light_field:
        return train(settings, catalogue.spec(name).weights or name)
    path = catalogue.weights_path(name, settings.scale)
    return path if path.exists() else None


def trained_folder(settings: Settings) -> Path:
    """Where this run's own weights go; another number of epochs is another schedule."""
    return settings.output / f"weights-{settings.train_epochs}epochs"


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
    """Train a network by the short recipe for the epochs of the settings; a run that was stopped continues.

    LfsrError where photographs are missing; KeyboardInterrupt if it is stopped.
    """
    from lfsr_lab.train import loop, session

    folder = trained_folder(settings) / "runs" / f"{name}-x{settings.scale}"
    changes = {"network": name, "scale": settings.scale, "epochs": settings.train_epochs,
               "adversarial": ADVERSARIAL if name.endswith("-gan") else 0.0, "validate_every": 1000000,
               "photographs": settings.photographs, "validation": settings.validation, "start": _start(settings, name)}
    config = load_config(SHORT_CONFIG, [f"{key}={value}" for key, value in changes.items() if value != ""])
    to_stderr(f"train   {name} x{settings.scale}: {config.epochs} epochs")
    with contextlib.closing(ProgressBar()) as bar:
        options = loop.RunOptions(resume=(folder / loop.CHECKPOINT).exists(), progress=bar)
        trained = session.train(config, folder, settings.device, options)
    if trained.weights is None:
        raise KeyboardInterrupt
    return _published(trained.weights, trained_folder(settings))


def _published(weights_file: Path, folder: Path) -> Path:
    """Copy weights, their provenance first: weights that exist are complete."""
    for suffix in (".json", ".safetensors"):
        with atomic_path(folder / f"{weights_file.stem}{suffix}") as temporary:
            shutil.copy(weights_file.with_suffix(suffix), temporary)
    return folder / weights_file.name


def _start(settings: Settings, name: str) -> str:
    """Return the weights that training begins with: an adversary meets a trained generator, for want of days."""
    generator = name.removesuffix("-gan")
    found = None if generator == name else weights(settings, generator)
    return str(found.resolve()) if found else ""


def _is_full(config: dict[str, Any]) -> bool:
    """True if the recipe is that of the network's built-in config."""
    name = config["network"]
    if name not in builtin_configs():
        return False
    recipe = dataclasses.asdict(load_config(name, [f"scale={config.get('scale', 4)}"]))
    return all(config.get(key) == recipe[key] for key in RECIPE)
