"""Weights of each network, how they were trained, and training of those that are missing."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.base.files import read_json
from lfsr_core.base.notices import ProgressBar
from lfsr_lab.experiments.engine.records import to_stderr
from lfsr_lab.experiments.seed_paper.renders import SCALE, Settings
from lfsr_lab.networks import comparators
from lfsr_lab.networks.methods import LabMethod, Ready
from lfsr_lab.train.config import load_config

if TYPE_CHECKING:
    from torch import nn
SHORT_CONFIG, ADVERSARIAL = "paper-short", 1e-3
NONE = "no weights"


def weights(settings: Settings, name: str) -> Path | None:
    """Return the weights of a network, None if there are none.

    Those given, else those trained in this output folder (now, if epochs were granted), else those that ship.
    """
    for folder in filter(None, (settings.weights, trained_folder(settings, name))):
        path = comparators.weights_path(name, SCALE, folder)
        if path.with_suffix(".json").exists():  # written last
            return path
    if settings.train_epochs > 0:
        return train(settings, comparators.spec(name).stem)
    return comparators.spec(name).weights.get(SCALE)


def trained_folder(settings: Settings, name: str) -> Path:
    """Return the folder where a network is trained; another number of epochs is another schedule."""
    return settings.output / f"weights-{settings.train_epochs}epochs" / comparators.spec(name).stem


def schedule(path: Path | None) -> str:
    """Return how weights were trained, in one phrase whose last part is time and device."""
    if path is None:
        return NONE
    facts = _provenance(path)
    config, took = facts.get("config", {}), f"{facts.get('seconds', 0.0):.0f} s on {facts.get('device')}"
    if not {"epochs", "crop", "rate", "schedule"} <= config.keys():
        return "schedule not recorded"
    start = ", begun from the trained generator" if config.get("start") else ""
    return (f"{config['epochs']} epochs of {config['crops_per_photograph']} {config['crop']}-pixel crops per "
            f"photograph, rate {config['rate']:g} {config['schedule']}{start}, {took}")


def _provenance(path: Path) -> dict[str, Any]:
    return read_json(path.with_suffix(".json"), "the provenance beside the weights")


def fingerprints(settings: Settings, name: str) -> dict[str, str | None]:
    """Return the hash of the weights of a method's network, None where there are none; empty without a network."""
    network = LabMethod.parse(name).network
    path = weights(settings, network) if network else None
    return {network: _provenance(path).get("sha256") if path else None} if network else {}


def schedules(settings: Settings, names: Iterable[str]) -> dict[str, str]:
    """Return how the network of each method was trained; methods without one are left out."""
    networks = {name: network for name in names if (network := LabMethod.parse(name).network)}
    return {name: schedule(weights(settings, network)) for name, network in networks.items()}


def method(settings: Settings, name: str) -> Ready | None:
    """Return a method, its network with the weights chosen here; None where these are missing."""
    parsed = LabMethod.parse(name)
    path = weights(settings, parsed.network) if parsed.network else None
    return None if parsed.network and path is None else parsed.ready(path, settings.device)


def untrained(name: str, scale: int) -> nn.Module:
    """Return a network with random weights of seed 0: its speed does not depend on them."""
    import torch

    from lfsr_lab.networks.networks import build

    torch.manual_seed(0)
    return build(name, scale).eval().requires_grad_(False)


def untrained_method(settings: Settings, name: str, scale: int) -> Ready:
    """Return the method for timing at any scale, its network with random weights."""
    if not LabMethod.parse(name).network:
        return LabMethod.parse(name).ready()
    from lfsr_lab.networks import checkpoint as files

    path = comparators.weights_path(name, scale, settings.output / "untrained")
    if not path.exists():
        files.save(path, untrained(name, scale), scale, {"untrained": True}, comparators.spec(name).options)
    return LabMethod.parse(name).ready(path, settings.device)


def train(settings: Settings, name: str) -> Path:
    """Train a network by the short recipe for the epochs of the settings; a run that was stopped continues.

    LfsrError where photographs are missing; KeyboardInterrupt if it is stopped.
    """
    from lfsr_lab.train import loop, session

    folder = trained_folder(settings, name)
    changes: dict[str, Any] = {"network": name, "scale": SCALE, "epochs": settings.train_epochs,
                               "validate_every": settings.train_epochs + 1}
    if settings.photographs:
        changes |= {"photographs": settings.photographs, "validation": settings.photographs}
    if name.endswith("-gan"):  # begins with the trained generator
        changes |= {"adversarial": ADVERSARIAL, "start": weights(settings, name.removesuffix("-gan"))}
    config = load_config(SHORT_CONFIG, [f"{key}={value}" for key, value in changes.items()])
    to_stderr(f"training {name} x{SCALE}: {config.epochs} epochs")
    with contextlib.closing(ProgressBar()) as bar:
        options = loop.RunOptions(resume=(folder / loop.CHECKPOINT).exists(), tell=bar)
        trained = session.train(config, folder, settings.device, options)
    if trained.weights is None:
        raise KeyboardInterrupt
    return trained.weights
