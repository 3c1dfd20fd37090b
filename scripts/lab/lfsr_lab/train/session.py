"""One training run, from its config to weights with provenance."""

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
from lfsr_core.files import read_json
from lfsr_core.reconstruct.networks import catalogue
from lfsr_lab.networks import checkpoint
from lfsr_lab.networks.cost import multiply_adds, parameters
from lfsr_lab.networks.engine import choose_device
from lfsr_lab.train.config import LightFieldTrainConfig, TrainConfig
from lfsr_lab.train.lightfields.data import load_scenes
from lfsr_lab.train.lightfields.task import LightFieldTask, digest
from lfsr_lab.train.lightfields.validation import SceneValidation
from lfsr_lab.train.loop import Outcome, RunOptions, Schedule, run
from lfsr_lab.train.photographs.data import Photographs, load_photographs
from lfsr_lab.train.photographs.task import ComparatorTask

LONG_SIDE = 1600
COUNTED_EI = 20
SCENE_SETTINGS = "settings.json"


@dataclass(frozen=True)
class Trained:
    """Result of a run."""

    weights: Path | None  # file written; None if the run was stopped early
    outcome: Outcome


@dataclass(frozen=True)
class PhotographFacts:
    """Photographs of a run."""

    files: int
    megapixels: float
    sha256: str

    @classmethod
    def of(cls, photographs: Photographs) -> PhotographFacts:
        """Facts of loaded photographs."""
        pixels = sum(image.shape[0] * image.shape[1] for image in photographs.images)
        return cls(len(photographs.names), round(pixels / 1e6, 2), photographs.digest)


@dataclass(frozen=True)
class ComparatorData:
    """Training and validation photographs of a comparator."""

    photographs: PhotographFacts
    validation: PhotographFacts | None


@dataclass(frozen=True)
class SceneData:
    """Training scenes of one of our networks."""

    scenes: int  # their number
    sha256: str
    settings: Any  # of training_scenes.py; None if the folder has none
    validation: list[str]  # scenes used for validation only


@dataclass(frozen=True)
class Provenance:
    """How weights were made; ``checkpoint.save`` writes it beside them."""

    network: str
    config: TrainConfig | LightFieldTrainConfig
    data: ComparatorData | SceneData
    seconds: float
    validation: dict[str, float]
    command: str
    versions: dict[str, str]
    device: str
    parameters: int
    multiply_adds_per_low_pixel: float


def train(config: TrainConfig | LightFieldTrainConfig, output: str | Path, device: str = "auto",
          options: RunOptions | None = None) -> Trained:
    """Train the network of ``config``; write weights, log, curves and checkpoint to the folder ``output``.

    ``device``: "cpu", "cuda" or "auto". LfsrError if data, device or a checkpoint do not fit.
    """
    chosen = choose_device(device)
    torch.backends.cudnn.benchmark = True
    task: LightFieldTask | ComparatorTask
    data: SceneData | ComparatorData
    if isinstance(config, LightFieldTrainConfig):
        task, data = _light_field(config, chosen)
    else:
        task, data = _comparator(config, chosen)
    schedule = Schedule(config.epochs, config.validate_every, config.checkpoint_every)
    outcome = run(task, schedule, output, options)
    if outcome.stopped:
        return Trained(None, outcome)
    path = catalogue.weights_path(config.network, config.scale, output)
    checkpoint.save(path, task.finished, config.scale, asdict(_provenance(task, outcome, data)), task.options)
    return Trained(path, outcome)


def _comparator(config: TrainConfig, device: torch.device) -> tuple[ComparatorTask, ComparatorData]:
    photographs = load_photographs(config.photographs, LONG_SIDE)
    validation = load_photographs(config.validation) if config.validation else None
    scenes = SceneValidation(config.validation_scenes, config.scale, device) if config.validation_scenes else None
    task = ComparatorTask(config, photographs, validation, device, scenes.figures if scenes else None)
    return task, ComparatorData(PhotographFacts.of(photographs),
                                PhotographFacts.of(validation) if validation else None)


def _light_field(config: LightFieldTrainConfig, device: torch.device) -> tuple[LightFieldTask, SceneData]:
    scenes = load_scenes(config.scenes)
    settings = Path(config.scenes, SCENE_SETTINGS)
    known = read_json(settings, "settings of training scenes") if settings.exists() else None
    task = LightFieldTask(config, scenes, device)
    return task, SceneData(len(scenes), digest(scenes), known, [scene.name for scene in task.validation])


def _provenance(task: ComparatorTask | LightFieldTask, outcome: Outcome,
                data: ComparatorData | SceneData) -> Provenance:
    return Provenance(
        network=task.config.network,
        config=task.config,
        data=data,
        seconds=round(outcome.seconds, 1),
        validation=outcome.validation | task.yardstick(),
        command=_command(),
        versions={"lfsr": __version__, "python": platform.python_version(), "torch": torch.__version__,
                  "numpy": np.__version__},
        device=torch.cuda.get_device_name(task.device) if task.device.type == "cuda" else f"CPU {platform.machine()}",
        parameters=parameters(task.network),
        multiply_adds_per_low_pixel=multiply_adds(task.network, COUNTED_EI, COUNTED_EI))


def _command() -> str:
    """This process's command line, as a user types it."""
    program = Path(sys.argv[0]).name
    return shlex.join([*(["lfsr"] if program in ("lfsr", "cli.py") else ["python", program]), *sys.argv[1:]])
