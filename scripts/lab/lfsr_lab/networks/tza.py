"""Read and write weights of Open Image Denoise, TZA files, of which ``reconstruct.methods.denoise`` reads the bytes."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path, read_bytes
from lfsr_core.reconstruct.methods.denoise import HEADER, LAYOUTS, MAGIC, MINOR, MOST_BYTES, TYPES, VERSION, parse_tza

BASE = (32, 32, 48, 64, 80, 96, 96, 112, 112, 96, 96, 64, 64, 64, 32, 3)  # widths of the library's own networks,
SMALL = (32, 32, 32, 32, 32, 32, 32, 64, 64, 64, 64, 64, 32, 32, 32, 3)  # one channel count per layer
ALIGNMENT = 64


def read_tza(path: str | Path) -> dict[str, Array]:
    """Tensors of a file by name, float32 or float16 as stored; LfsrError where it is damaged or no such file."""
    return parse_tza(read_bytes(path, "TZA weights", MOST_BYTES), path)


def write_tza(path: str | Path, tensors: Mapping[str, Array], *, half: bool = True) -> None:
    """Write tensors of one or four axes, whole or not at all, as float16 (``half``) or float32.

    The library takes float16 alone. LfsrError where a value is not finite, which it may become as float16, or where
    there are too many.
    """
    kind = b"h" if half else b"f"
    with np.errstate(over="ignore"):
        stored = {name: np.ascontiguousarray(tensor, TYPES[kind]) for name, tensor in tensors.items()}
    body, table = bytearray(HEADER.size), bytearray(struct.pack("<I", len(stored)))
    for name, tensor in stored.items():
        if tensor.ndim not in LAYOUTS or not np.isfinite(tensor).all():
            raise LfsrError(f"tensor {name!r} of shape {tensor.shape} for {path} has values that are not finite, or "
                            "not 1 or 4 axes: check the training")
        body += bytes(-len(body) % ALIGNMENT)
        table += struct.pack("<H", len(name.encode())) + name.encode()
        table += struct.pack(f"<B{tensor.ndim}I", tensor.ndim, *tensor.shape) + LAYOUTS[tensor.ndim] + kind
        table += struct.pack("<Q", len(body))
        body += tensor.tobytes()
    HEADER.pack_into(body, 0, MAGIC, VERSION, MINOR, len(body))
    if len(body) + len(table) > MOST_BYTES:
        raise LfsrError(f"weights for {path} take {len(body)} bytes, expected at most {MOST_BYTES}: "
                        "use a smaller network")
    with atomic_path(path) as temporary:
        temporary.write_bytes(body + table)
