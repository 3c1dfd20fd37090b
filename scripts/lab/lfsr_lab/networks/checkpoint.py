"""Weights as safetensors with a provenance file beside them.

The header of ``NAME-xS.safetensors`` holds format version, architecture, scale,
options and a SHA-256 over the tensors; ``NAME-xS.json`` holds how they were made.
Nothing is ever unpickled.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors.numpy import save as to_bytes
from torch import nn

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, write_json
from lfsr_core.reconstruct.networks.weights_file import FORMAT, MAX_BYTES, VERSION, check_finite, digest, read


def save(path: str | Path, network: nn.Module, scale: int, provenance: Mapping[str, Any],
         options: Mapping[str, Any] | None = None) -> None:
    """Write the weights of ``network``, trained at ``scale``, to ``path``, and a JSON file of the same stem.

    ``provenance`` (how it was trained) goes into the JSON file, ``options`` (hyper-parameters) into the header too.
    LfsrError if the file would reach 1 MB or a value is not finite.
    """
    path = Path(path)
    tensors = {name: value.detach().cpu().contiguous().numpy() for name, value in network.state_dict().items()}
    _check_before_saving(path, tensors)
    header = {"format": FORMAT, "version": str(VERSION), "architecture": type(network).__name__, "scale": str(scale),
              "options": json.dumps(dict(options or {}), sort_keys=True, default=list), "sha256": digest(tensors)}
    with atomic_path(path) as temporary:
        temporary.write_bytes(to_bytes(tensors, header))
    facts = {**header, "version": VERSION, "scale": scale, "options": dict(options or {}),
             "bytes": path.stat().st_size}
    write_json(path.with_suffix(".json"), {**facts, **provenance})


def load_into(network: nn.Module, path: str | Path, scale: int) -> nn.Module:
    """Load the tensors of ``path`` into ``network`` and return it.

    LfsrError unless version, architecture, scale, shapes and hash all fit.
    """
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


def _check_before_saving(path: Path, tensors: Mapping[str, Array]) -> None:
    check_finite(path, tensors)
    size = sum(value.nbytes for value in tensors.values())
    if size >= MAX_BYTES:
        raise LfsrError(f"weights for {path} take {size} bytes, expected less than {MAX_BYTES}: use a smaller network")


def _check_shapes(path: Path, tensors: Mapping[str, Array], network: nn.Module) -> None:
    wanted = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    found = {name: tuple(value.shape) for name, value in tensors.items()}
    for name in sorted(wanted.keys() | found.keys()):
        if wanted.get(name) != found.get(name):
            raise LfsrError(f"{path} has tensor {name!r} of shape {found.get(name, 'missing')}, expected "
                            f"{wanted.get(name, 'no such tensor')}: choose the file that fits or train it again")
