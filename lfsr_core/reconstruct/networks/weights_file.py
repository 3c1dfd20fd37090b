"""Reading weights with NumPy alone: Blender's Python has neither PyTorch nor the safetensors package.

The file format: eight bytes with the length of the JSON header, the header, then
the tensors one after another (https://github.com/huggingface/safetensors). That
package is compiled for each platform, which would make the extension one zip each.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.errors import LfsrError

FORMAT, VERSION = "lfsr-weights", 1
MAX_BYTES = 1_000_000
TYPES = {"F32": np.dtype("<f4"), "F16": np.dtype("<f2"), "I64": np.dtype("<i8")}


def read(path: str | Path) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """Header and tensors; LfsrError for a damaged file, another format or version, or a wrong hash."""
    path = Path(path)
    try:
        header, tensors = _parse(path.read_bytes())
    except FileNotFoundError:
        raise LfsrError(f"{path} does not exist, expected weights: train them with 'lfsr train'") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise LfsrError(f"{path} cannot be read as safetensors weights ({error}): "
                        f"get it again or train it again") from None
    if header.get("format") != FORMAT:
        raise LfsrError(f"{path} is a safetensors file but not LFSR weights: choose a file written by 'lfsr train'")
    if header.get("version") != str(VERSION):
        raise LfsrError(f"{path} has weights format version {header.get('version')!r}, expected {VERSION}: "
                        f"train it again or use the matching LFSR")
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


def _parse(content: bytes) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """Header and tensors of a file's bytes; ValueError, KeyError or TypeError where they are damaged."""
    length = int.from_bytes(content[:8], "little")
    if len(content) < 8 or length > len(content) - 8:
        raise ValueError(f"{len(content)} bytes are too few for its header")
    entries: dict[str, Any] = json.loads(content[8:8 + length])
    metadata = entries.pop("__metadata__", {})
    body = content[8 + length:]
    return dict(metadata), {name: _tensor(entry, body) for name, entry in entries.items()}


def _tensor(entry: dict[str, Any], body: bytes) -> np.ndarray:
    kind, shape, (start, end) = TYPES[entry["dtype"]], tuple(entry["shape"]), entry["data_offsets"]
    if not 0 <= start <= end <= len(body) or end - start != kind.itemsize * math.prod(shape):
        raise ValueError(f"a tensor of shape {shape} does not fit bytes {start} to {end}")
    return np.frombuffer(body[start:end], kind).reshape(shape).copy()
