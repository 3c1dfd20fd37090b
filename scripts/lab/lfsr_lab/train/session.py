"""One training run, from its config to weights with provenance."""

from __future__ import annotations

import dataclasses
import platform
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch

from lfsr_core import __version__
from lfsr_lab.networks import checkpoint, comparators
from lfsr_lab.networks.cost import multiply_adds, parameters
from lfsr_lab.networks.engine import choose_device
from lfsr_lab.train.config import TrainConfig
from lfsr_lab.train.loop import Outcome, RunOptions, Schedule, run
from lfsr_lab.train.photographs.data import load_photographs
from lfsr_lab.train.photographs.task import ComparatorTask

LONG_SIDE = 1600
COUNTED_EI = 20


def train(config: TrainConfig, output: str | Path, device: str = "auto", options: RunOptions | None = None) -> Outcome:
    """Train the network of ``config``; write weights, log, curves and checkpoint to the folder ``output``.

    ``device``: "cpu", "cuda" or "auto". LfsrError if data, device or a checkpoint do not fit.
    """
    photographs = load_photographs(config.photographs, LONG_SIDE)
    validation = load_photographs(config.validation) if config.validation else None
    task = ComparatorTask(config, photographs, validation, choose_device(device))
    torch.backends.cudnn.benchmark = True
    outcome = run(task, Schedule(config.epochs, config.validate_every, config.checkpoint_every), output, options)
    if outcome.stopped:
        return outcome
    path = comparators.weights_path(config.network, config.scale, output)
    checkpoint.save(path, task.finished, config.scale, _provenance(task, outcome), task.options)
    return dataclasses.replace(outcome, weights=path)


def _provenance(task: ComparatorTask, outcome: Outcome) -> dict[str, Any]:
    """How the weights were made, for the JSON file beside them."""
    return {
        "network": task.config.network,
        "config": dataclasses.asdict(task.config),
        "data": task.data(),
        "seconds": round(outcome.seconds, 1),
        "validation": outcome.validation | task.yardstick(),
        "command": _command(),
        "versions": {"lfsr": __version__, "python": platform.python_version(), "torch": torch.__version__,
                     "numpy": np.__version__},
        "device": (torch.cuda.get_device_name(task.device) if task.device.type == "cuda"
                   else f"CPU {platform.machine()}"),
        "parameters": parameters(task.network),
        "multiply_adds_per_low_pixel": multiply_adds(task.network, COUNTED_EI, COUNTED_EI)}


def _command() -> str:
    """This process's command line, as a user types it."""
    program = Path(sys.argv[0]).name
    return shlex.join([*(["lfsr"] if program in ("lfsr", "cli.py") else ["python", program]), *sys.argv[1:]])
