"""Weights as safetensors with a provenance file beside them.

The header of ``NAME-xS.safetensors`` says format version, architecture, scale,
options and a SHA-256 over the tensors; ``NAME-xS.json`` says how they were made.
Nothing is ever unpickled.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file
from torch import nn

from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, write_json

FORMAT, VERSION = "lfsr-weights", 1
MAX_BYTES = 1_000_000


def save(path: str | Path, network: nn.Module, scale: int, provenance: Mapping[str, Any],
         options: Mapping[str, Any] | None = None) -> None:
    """Write weights and, beside them, ``provenance`` plus the file's own facts as JSON.

    LfsrError if the file would reach 1 MB or a value is not finite.
    """
    path = Path(path)
    tensors = {name: value.detach().cpu().contiguous().numpy() for name, value in network.state_dict().items()}
    _check_before_saving(path, tensors)
    header = {"format": FORMAT, "version": str(VERSION), "architecture": type(network).__name__, "scale": str(scale),
              "options": json.dumps(dict(options or {}), sort_keys=True, default=list), "sha256": digest(tensors)}
    with atomic_path(path) as temporary:
        save_file(tensors, temporary, metadata=header)
    facts = {**header, "version": VERSION, "scale": scale, "options": dict(options or {}),
             "bytes": path.stat().st_size}
    write_json(path.with_suffix(".json"), {**facts, **provenance})


def load_into(network: nn.Module, path: str | Path, scale: int) -> nn.Module:
    """The same network with the tensors of ``path``; LfsrError unless version, architecture,
    scale, shapes and hash all fit."""
    path = Path(path)
    header, tensors = read(path)
    expected = {"architecture": type(network).__name__, "scale": str(scale)}
    for key, wanted in expected.items():
        if header.get(key) != wanted:
            raise LfsrError(f"{path} holds weights for {key} {header.get(key)!r}, expected {wanted!r}: "
                            f"choose the file that fits or train it again")
    _check_shapes(path, tensors, network)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in tensors.items()})
    return network


def options_of(path: str | Path) -> dict[str, Any]:
    """Hyper-parameters in the header of a weights file."""
    return json.loads(_header(Path(path))["options"])


def read(path: str | Path) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """Header and tensors; LfsrError for a damaged file, another version or a wrong hash."""
    path = Path(path)
    header = _header(path)
    try:
        with safe_open(path, framework="numpy") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no mapping)
    except (SafetensorError, OSError) as error:
        raise _damaged(path, error) from None
    if digest(tensors) != header.get("sha256"):
        raise LfsrError(f"{path} does not match the SHA-256 in its header: it was changed or damaged, get it again")
    return header, tensors


def digest(tensors: Mapping[str, np.ndarray]) -> str:
    """SHA-256 over names, types, shapes and bytes, in the order of the names."""
    state = hashlib.sha256()
    for name in sorted(tensors):
        value = np.ascontiguousarray(tensors[name])
        state.update(f"{name} {value.dtype.str} {value.shape}\n".encode())
        state.update(value.tobytes())
    return state.hexdigest()


def _header(path: Path) -> dict[str, str]:
    try:
        with safe_open(path, framework="numpy") as file:
            header = file.metadata() or {}
    except FileNotFoundError:
        raise LfsrError(f"{path} does not exist, expected weights: train them with 'lfsr train'") from None
    except (SafetensorError, OSError) as error:
        raise _damaged(path, error) from None
    if header.get("format") != FORMAT:
        raise LfsrError(f"{path} is a safetensors file but not LFSR weights: choose a file written by 'lfsr train'")
    if header.get("version") != str(VERSION):
        raise LfsrError(f"{path} has weights format version {header.get('version')!r}, expected {VERSION}: "
                        f"train it again or use the matching LFSR")
    return header


def _damaged(path: Path, error: Exception) -> LfsrError:
    return LfsrError(f"{path} cannot be read as safetensors weights ({error}): get it again or train it again")


def _check_before_saving(path: Path, tensors: Mapping[str, np.ndarray]) -> None:
    broken = [name for name, value in tensors.items() if not np.isfinite(value).all()]
    if broken:
        raise LfsrError(f"weights {broken[0]!r} for {path} are not finite: training diverged, lower the rate")
    size = sum(value.nbytes for value in tensors.values())
    if size >= MAX_BYTES:
        raise LfsrError(f"weights for {path} take {size} bytes, expected less than {MAX_BYTES}: use a smaller network")


def _check_shapes(path: Path, tensors: Mapping[str, np.ndarray], network: nn.Module) -> None:
    wanted = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    found = {name: tuple(value.shape) for name, value in tensors.items()}
    for name in sorted(wanted.keys() | found.keys()):
        if wanted.get(name) != found.get(name):
            raise LfsrError(f"{path} has tensor {name!r} of shape {found.get(name, 'missing')}, expected "
                            f"{wanted.get(name, 'no such tensor')}: choose the file that fits or train it again")
