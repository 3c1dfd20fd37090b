"""TZA files: tensors as Open Image Denoise reads its weights.

Little-endian: magic number, version, offset of the table; the values, each tensor at a multiple of 64 bytes; the table.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, read_bytes

HEADER = struct.Struct("<HBBQ")  # magic number, version, its second part, offset of the table
MAGIC, VERSION, MINOR = 0x41D7, 2, 0
ALIGNMENT = 64
MOST_BYTES, MOST_TENSORS = 8_000_000, 256
LAYOUTS = {1: b"x", 4: b"oihw"}  # by number of axes
TYPES: dict[bytes, np.dtype[Any]] = {b"f": np.dtype("<f4"), b"h": np.dtype("<f2")}


def read_tza(path: str | Path) -> dict[str, Array]:
    """Tensors of a file by name, float32 or float16 as stored; LfsrError where it is damaged or no such file."""
    return parse(read_content(path), path)


def read_content(path: str | Path) -> bytes:
    """Bytes of a file of at most MOST_BYTES; LfsrError where it cannot be read."""
    return read_bytes(path, "TZA weights", MOST_BYTES)


def parse(content: bytes, origin: object) -> dict[str, Array]:
    """Tensors of a file's bytes; ``origin`` names them in the LfsrError of damaged ones."""
    try:
        return dict(_entries(content))
    except (ValueError, struct.error) as error:
        raise LfsrError(f"{origin} cannot be read as TZA weights ({error}): get it again or train it again") from None


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


def _entries(content: bytes) -> Iterator[tuple[str, Array]]:
    """Name and values of every tensor; ValueError or struct.error where the bytes are damaged."""
    magic, version, _, at = HEADER.unpack_from(content)
    if (magic, version) != (MAGIC, VERSION):
        raise ValueError(f"it begins with {magic:#06x} version {version}, expected {MAGIC:#06x} version {VERSION}")
    if at > len(content):
        raise ValueError(f"its table is at byte {at} of {len(content)}")
    (count,) = struct.unpack_from("<I", content, at)
    if count > MOST_TENSORS:
        raise ValueError(f"it has {count} tensors, expected at most {MOST_TENSORS}")
    at, seen = at + 4, set[str]()
    for _ in range(count):
        (length,) = struct.unpack_from("<H", content, at)
        name, at = content[at + 2:at + 2 + length].decode("ascii", errors="replace"), at + 2 + length
        (axes,) = struct.unpack_from("<B", content, at)
        if axes not in LAYOUTS:
            raise ValueError(f"tensor {name[:40]!r} has {axes} axes, expected 1 or 4")
        *shape, layout, kind, start = struct.unpack_from(f"<{axes}I{axes}scQ", content, at + 1)
        at += struct.calcsize(f"<B{axes}I{axes}scQ")
        if layout != LAYOUTS[axes] or kind not in TYPES:
            raise ValueError(f"tensor {name[:40]!r} has layout {layout!r} and type {kind!r}, expected "
                             f"{LAYOUTS[axes]!r} and b'f' or b'h'")
        size = math.prod(shape)
        if not 0 < size <= MOST_BYTES or start + size * TYPES[kind].itemsize > len(content):
            raise ValueError(f"tensor {name[:40]!r} of shape {tuple(shape)} at byte {start} does not fit "
                             f"{len(content)} bytes")
        tensor = np.frombuffer(content, TYPES[kind], size, start).reshape(shape)
        if not np.isfinite(tensor).all():
            raise ValueError(f"tensor {name[:40]!r} has values that are not finite")
        if name in seen:
            raise ValueError(f"it has tensor {name!r} twice")
        seen.add(name)
        yield name, tensor
