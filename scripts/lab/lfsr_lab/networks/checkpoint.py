"""Weights as safetensors with a provenance file beside them.

The header of ``NAME-xS.safetensors`` holds format version, architecture, scale, options and a SHA-256 over the tensors;
``NAME-xS.json`` holds how they were made. Nothing is ever unpickled.
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
from safetensors.numpy import load as from_bytes
from safetensors.numpy import save as to_bytes
from torch import nn

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path, read_bytes, write_json

FORMAT, VERSION = "lfsr-weights", 1
MAX_BYTES = 1_000_000


def save(path: str | Path, network: nn.Module, scale: int, provenance: Mapping[str, Any],
         options: Mapping[str, Any] | None = None) -> None:
    """Write the weights of ``network``, trained at ``scale``, to ``path``, and a JSON file of the same stem.

    ``provenance`` (how it was trained) goes into the JSON file, ``options`` (hyper-parameters) into the header too.
    LfsrError if the file would reach 1 MB or a value is not finite.
    """
    path = Path(path)
    tensors = {name: value.detach().cpu().contiguous().numpy() for name, value in network.state_dict().items()}
    check_finite(path, tensors)
    size = sum(value.nbytes for value in tensors.values())
    if size >= MAX_BYTES:
        raise LfsrError(f"weights for {path} take {size} bytes, expected less than {MAX_BYTES}: use a smaller network")
    header = {"format": FORMAT, "version": str(VERSION), "architecture": type(network).__name__, "scale": str(scale),
              "options": json.dumps(dict(options or {}), sort_keys=True, default=list), "sha256": digest(tensors)}
    with atomic_path(path) as temporary:
        temporary.write_bytes(to_bytes(tensors, header))
    facts = {**header, "version": VERSION, "scale": scale, "options": dict(options or {}), "bytes": path.stat().st_size}
    write_json(path.with_suffix(".json"), {**facts, **provenance})


def read(path: str | Path) -> tuple[dict[str, str], dict[str, Array]]:
    """Header and tensors of a file; LfsrError where it is damaged, of another format or version, or not finite."""
    path = Path(path)
    content = read_bytes(path, "weights, as 'lfsr train' makes", 2 * MAX_BYTES)
    try:
        tensors = from_bytes(content)
        with safe_open(path, "np") as file:
            header = file.metadata() or {}
    except SafetensorError as error:
        raise LfsrError(f"{path} cannot be read as safetensors weights ({error}): "
                        "get it again or train it again") from None
    if header.get("format") != FORMAT:
        raise LfsrError(f"{path} is a safetensors file but not LFSR weights: choose a file written by 'lfsr train'")
    if header.get("version") != str(VERSION):
        raise LfsrError(f"{path} has weights format version {header.get('version')!r}, expected {VERSION}: "
                        "train it again or use the matching LFSR")
    if digest(tensors) != header.get("sha256"):
        raise LfsrError(f"{path} does not match the SHA-256 in its header: it was changed or damaged, get it again")
    check_finite(path, tensors)
    return header, tensors


def load_into(network: nn.Module, path: str | Path, scale: int) -> nn.Module:
    """Load the tensors of ``path`` into ``network`` and return it.

    LfsrError unless version, architecture, scale, shapes and hash all fit.
    """
    path = Path(path)
    header, tensors = read(path)
    for key, value in (("architecture", type(network).__name__), ("scale", str(scale))):
        if header.get(key) != value:
            raise LfsrError(f"{path} holds weights for {key} {header.get(key)!r}, expected {value!r}: "
                            f"choose the file that fits or train it again")
    wanted = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    stored = {name: tuple(value.shape) for name, value in tensors.items()}
    for name in sorted(wanted.keys() | stored.keys()):
        if wanted.get(name) != stored.get(name):
            raise LfsrError(f"{path} has tensor {name!r} of shape {stored.get(name, 'missing')}, expected "
                            f"{wanted.get(name, 'no such tensor')}: choose the file that fits or train it again")
    network.load_state_dict({name: torch.from_numpy(value) for name, value in tensors.items()})
    return network


def check_finite(path: str | Path, tensors: Mapping[str, Array]) -> None:
    """LfsrError if one of the ``tensors`` for the file ``path`` has NaN or infinite values."""
    for name, value in tensors.items():
        if not np.isfinite(value).all():
            raise LfsrError(f"weights {name!r} of {path} are not finite: the training diverged, train it again at a "
                            "lower rate")


def digest(tensors: Mapping[str, Array]) -> str:
    """SHA-256 of the names, types, shapes and bytes of tensors, sorted by name."""
    state = hashlib.sha256()
    for name in sorted(tensors):
        value = np.ascontiguousarray(tensors[name])
        state.update(f"{name} {value.dtype.str} {value.shape}\n".encode())
        state.update(value.tobytes())
    return state.hexdigest()
