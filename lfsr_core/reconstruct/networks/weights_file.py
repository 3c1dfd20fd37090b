"""Read weights with NumPy alone, as Blender's Python has neither PyTorch nor the safetensors package.

A file holds eight bytes with the length of the JSON header, the header, and the tensors one after another
(https://github.com/huggingface/safetensors). That package is compiled, so the extension would need a zip per platform.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.files import parse_json, read_bytes
from lfsr_core.records import from_data

FORMAT, VERSION = "lfsr-weights", 1
MAX_BYTES, MOST_AXES = 1_000_000, 8
TYPES: dict[str, np.dtype[Any]] = {"F32": np.dtype("<f4"), "F16": np.dtype("<f2"), "I64": np.dtype("<i8")}


def read(path: str | Path) -> tuple[dict[str, str], dict[str, Array]]:
    """Header and tensors of a file; LfsrError where it is damaged, of another format or version, or not finite."""
    path = Path(path)
    content = read_bytes(path, "weights, as 'lfsr train' makes", 2 * MAX_BYTES)
    try:
        header, tensors = _parse(content)
    except ValueError as error:
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


@dataclasses.dataclass(frozen=True)
class _Entry:
    """A tensor in the header; ``data_offsets``: begin and end of its bytes in the body."""

    dtype: Literal["F32", "F16", "I64"]
    shape: tuple[int, ...]
    data_offsets: tuple[int, int]


def _parse(content: bytes) -> tuple[dict[str, str], dict[str, Array]]:
    """Header and tensors of a file's bytes; ValueError where they are damaged."""
    length = int.from_bytes(content[:8], "little")
    if len(content) < 8 or length > len(content) - 8:
        raise ValueError(f"{len(content)} bytes are too few for its header")
    entries = from_data(dict[str, Any], parse_json(content[8:8 + length]), "header")
    metadata = from_data(dict[str, str], entries.pop("__metadata__", {}), "header")
    body = content[8 + length:]
    known = from_data(dict[str, _Entry], entries, "header")
    return metadata, {name: _tensor(entry, body) for name, entry in known.items()}


def _tensor(entry: _Entry, body: bytes) -> Array:
    kind, shape, (start, end) = TYPES[entry.dtype], entry.shape, entry.data_offsets
    fits = len(shape) <= MOST_AXES and all(0 <= count <= MAX_BYTES for count in shape)
    if not (fits and 0 <= start <= end <= len(body) and end - start == kind.itemsize * math.prod(shape)):
        raise ValueError(f"a tensor of shape {shape[:MOST_AXES]} does not fit bytes {start} to {end}")
    return np.frombuffer(body[start:end], kind).reshape(shape).copy()
