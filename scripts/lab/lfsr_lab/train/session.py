"""One training run, from its config to weights with provenance."""

from __future__ import annotations

import dataclasses
import hashlib
import platform
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch

from lfsr_core import __version__
from lfsr_core.base.system import write_json
from lfsr_lab.networks import checkpoint, comparators
from lfsr_lab.networks.networks import multiply_adds, parameters
from lfsr_lab.networks.tza import write_tza
from lfsr_lab.networks.upscalers import choose_device
from lfsr_lab.train.config import DENOISER, DenoiserConfig, TrainConfig
from lfsr_lab.train.denoiser.data import load_scenes
from lfsr_lab.train.denoiser.task import DenoiserTask
from lfsr_lab.train.loop import Outcome, RunOptions, Schedule, run
from lfsr_lab.train.photographs.task import ComparatorTask, load_photographs

LONG_SIDE = 1600
COUNTED_EI = 20


def train(config: TrainConfig | DenoiserConfig, output: str | Path, device: str = "auto",
          options: RunOptions | None = None) -> Outcome:
    """Train the network of ``config``; write weights, log, curves and checkpoint to the folder ``output``.

    ``device``: "cpu", "cuda" or "auto". LfsrError if data, device or a checkpoint do not fit.
    """
    schedule = Schedule(config.epochs, config.validate_every, config.checkpoint_every)
    if isinstance(config, DenoiserConfig):
        denoiser = DenoiserTask(config, load_scenes(config.scenes, config.count), choose_device(device))
        outcome = run(denoiser, schedule, output, options)
        if outcome.stopped:
            return outcome
        path = Path(output, f"{DENOISER}.tza")
        write_tza(path, denoiser.finished.tensors())
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        write_json(path.with_suffix(".json"),
                   {"sha256": digest} | _provenance(denoiser, outcome, {}, denoiser.device))
        return dataclasses.replace(outcome, weights=path)
    photographs = load_photographs(config.photographs, LONG_SIDE)
    validation = load_photographs(config.validation) if config.validation else None
    task = ComparatorTask(config, photographs, validation, choose_device(device))
    torch.backends.cudnn.benchmark = True
    outcome = run(task, schedule, output, options)
    if outcome.stopped:
        return outcome
    path = comparators.weights_path(config.network, config.scale, output)
    facts: dict[str, Any] = {"multiply_adds_per_low_pixel": multiply_adds(task.network, COUNTED_EI, COUNTED_EI)}
    facts |= _provenance(task, outcome, task.yardstick(), task.device)
    checkpoint.save(path, task.finished, config.scale, facts, task.options)
    return dataclasses.replace(outcome, weights=path)


def _provenance(task: ComparatorTask | DenoiserTask, outcome: Outcome, yardstick: dict[str, float],
                device: torch.device) -> dict[str, Any]:
    """How the weights were made, for the JSON file beside them."""
    program = Path(sys.argv[0]).name
    command = shlex.join([*(["lfsr"] if program in ("lfsr", "__main__.py") else ["python", program]), *sys.argv[1:]])
    return {"network": task.config.network, "config": dataclasses.asdict(task.config), "data": task.data(),
            "seconds": round(outcome.seconds, 1), "validation": outcome.validation | yardstick, "command": command,
            "versions": {"lfsr": __version__, "python": platform.python_version(), "torch": torch.__version__,
                         "numpy": np.__version__}, "device": torch.cuda.get_device_name(device) if device.type == "cuda"
            else f"CPU {platform.machine()}", "parameters": parameters(task.network)}

