"""Stored weights of others, read from a folder that holds clones of their repositories. No code of theirs is run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import torch

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError


def stored(clones: Path, path: str) -> Path:
    """Return a file of a clone; LfsrError where it is missing."""
    file = clones / path
    if not file.is_file():
        raise LfsrError(f"{file} does not exist, expected stored weights: clone the repository {Path(path).parts[0]!r} "
                        f"into {clones}")
    return file


def cells(clones: Path, path: str) -> list[tuple[Array, Array]]:
    """Return (weights, biases) of every layer in a MATLAB file with the cell arrays ``weight`` and ``bias``."""
    found = scipy.io.loadmat(stored(clones, path))
    return [(weight, bias.ravel()) for weight, bias in zip(found["weight"].ravel(), found["bias"].ravel(), strict=True)]


def parameters(clones: Path, path: str) -> dict[str, Array]:
    """Return the parameters of a MatConvNet DAG in a MATLAB file, by name."""
    found = scipy.io.loadmat(stored(clones, path))["net"]["params"][0, 0]
    return {str(name.item()): np.asarray(value) for name, value in
            zip(found["name"].ravel(), found["value"].ravel(), strict=True)}


def state(clones: Path, path: str) -> dict[str, Any]:
    """Return the tensors of a PyTorch checkpoint, by name."""
    return dict(torch.load(stored(clones, path), map_location="cpu", weights_only=True))
