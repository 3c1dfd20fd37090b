"""One training run from config to weights with provenance."""

from __future__ import annotations

import platform
import shlex
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from lfsr_core import __version__
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.networks.pytorch import checkpoint
from lfsr_core.reconstruct.networks.pytorch.cost import multiply_adds, parameters
from lfsr_core.reconstruct.networks.pytorch.lightfield import LightFieldNet
from lfsr_core.reconstruct.networks.pytorch.lightfield import multiply_adds as light_field_multiply_adds
from lfsr_core.train.config import LightFieldTrainConfig, TrainConfig
from lfsr_core.train.lightfields.data import load_scenes
from lfsr_core.train.lightfields.task import LightFieldTask, digest
from lfsr_core.train.loop import Outcome, Progress, Schedule, Stop, run
from lfsr_core.train.photographs.data import Photographs, load_photographs
from lfsr_core.train.photographs.task import ComparatorTask

LONG_SIDE = 1600
COUNTED_EI = 20
SCENE_SETTINGS = "settings.json"


@dataclass(frozen=True)
class Trained:
    """Weights file written (None if the run was stopped before its end) and how the run went."""

    weights: Path | None
    outcome: Outcome


def train(config: TrainConfig | LightFieldTrainConfig, output: str | Path, *, device: str = "auto",
          resume: bool = False, progress: Progress | None = None, stop: Stop | None = None) -> Trained:
    """Train as ``config`` says; the weights go to ``output`` with log, curves and checkpoint.

    LfsrError for data, device or a checkpoint that do not fit.
    """
    output, chosen = Path(output), choose_device(device)
    torch.backends.cudnn.benchmark = True
    task, data = _light_field(config, chosen) if isinstance(config, LightFieldTrainConfig) else _comparator(
        config, chosen)
    schedule = Schedule(config.epochs, config.validate_every, config.checkpoint_every)
    outcome = run(task, schedule, output, resume=resume, progress=progress, stop=stop)
    if outcome.stopped:
        return Trained(None, outcome)
    path = catalogue.weights_path(config.network, config.scale, output)
    save_trained(task, path, outcome, data)
    return Trained(path, outcome)


def save_trained(task: ComparatorTask | LightFieldTask, path: Path, outcome: Outcome, data: dict[str, Any]) -> None:
    """Weights and the JSON that says how they came to be."""
    light_field = isinstance(task, LightFieldTask)
    provenance = {
        "network": task.config.network,
        "config": asdict(task.config),
        "data": data,
        "seconds": round(outcome.seconds, 1),
        "validation": {**outcome.validation, **({} if light_field else task.bicubic())},
        **facts(task.network, task.device),
    }
    if light_field:
        options, network = task.config.options(), task.average
    else:
        options, network = catalogue.spec(task.config.network).options, task.network
    checkpoint.save(path, network, task.config.scale, provenance, options)


def _comparator(config: TrainConfig, device: torch.device) -> tuple[ComparatorTask, dict[str, Any]]:
    photographs = load_photographs(config.photographs, LONG_SIDE)
    validation = load_photographs(config.validation) if config.validation else None
    data = {"photographs": _data_facts(photographs), "validation": validation and _data_facts(validation)}
    return ComparatorTask(config, photographs, validation, device), data


def _light_field(config: LightFieldTrainConfig, device: torch.device) -> tuple[LightFieldTask, dict[str, Any]]:
    scenes = load_scenes(config.scenes)
    settings = Path(config.scenes, SCENE_SETTINGS)
    data = {"scenes": len(scenes), "sha256": digest(scenes),
            "settings": read_json(settings, "settings of training scenes") if settings.exists() else None}
    task = LightFieldTask(config, scenes, device)
    return task, data | {"validation": [scene.name for scene in task.validation]}


def facts(network: torch.nn.Module, device: torch.device) -> dict[str, Any]:
    """What every provenance holds: command, versions, device and the cost of the network."""
    return {
        "command": _command(),
        "versions": {"lfsr": __version__, "python": platform.python_version(), "torch": torch.__version__,
                     "numpy": np.__version__},
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else f"CPU {platform.machine()}",
        "parameters": parameters(network),
        "multiply_adds_per_low_pixel": _multiply_adds(network),
    }


def _multiply_adds(network: torch.nn.Module) -> float:
    if isinstance(network, LightFieldNet):
        return light_field_multiply_adds(network.config)
    return multiply_adds(network, COUNTED_EI, COUNTED_EI)


def choose_device(name: str) -> torch.device:
    """Device "cpu", "cuda" or "auto"; LfsrError if CUDA is asked for and absent."""
    if name not in ("auto", "cpu", "cuda"):
        raise LfsrError(f"device {name!r} is unknown: choose cpu, cuda or auto")
    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise LfsrError("device 'cuda' is not available on this machine: choose cpu or auto")
    return torch.device("cuda" if available and name != "cpu" else "cpu")


def _data_facts(photographs: Photographs) -> dict[str, Any]:
    megapixels = sum(image.shape[0] * image.shape[1] for image in photographs.images) / 1e6
    return {"files": len(photographs.names), "megapixels": round(megapixels, 2), "sha256": photographs.digest}


def _command() -> str:
    """This process's command line as a user types it."""
    program = Path(sys.argv[0]).name
    return shlex.join([*(["lfsr"] if program in ("lfsr", "cli.py") else ["python", program]), *sys.argv[1:]])
