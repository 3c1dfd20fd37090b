"""Digest of the scene in a file, which stays the same where Blender saves the same scene anew.

A .blend file is a list of blocks. Each has the address that it had in memory, and pointers in blocks are such
addresses. With every address replaced by the number of its block, and without the blocks of windows, brushes and other
tools, two copies of one scene have the same bytes.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.files import system_errors

BLEND_MAGIC = b"BLENDER"
OLD_HEADER, OLD_BLOCK = 12, struct.Struct("<4siQii")  # code, size, address, kind, count
NEW_BLOCK = struct.Struct("<4siQqq")  # since 5.0: code, kind, address, size, count
# Blocks of the file itself, of windows and of tools: no pixel depends on them.
NOT_SCENE = (b"GLOB", b"REND", b"TEST", b"USER", b"DNA1", b"WM", b"SN", b"SR", b"WS", b"BR", b"PL", b"PC")
DATA, END = b"DATA", b"ENDB"
# Bytes of a data-block's tags, users and number in the session, before and since 5.0 (DNA_ID.h).
OLD_SESSION, NEW_SESSION = slice(108, 136), slice(300, 328)
# First letters of the names of data-blocks inside others: node trees and a scene's collection.
NAME, EMBEDDED = slice(40, 42), (b"NT", b"GR")
COMPANIONS = (".bin", ".mtl")  # beside .gltf and .obj
CHUNK = 1 << 20


class _Block(NamedTuple):
    code: bytes
    kind: int
    address: int
    start: int
    size: int
    session: slice  # bytes that belong to the session, not to the scene


def scene_content(path: str | Path) -> str:
    """Return the digest of a scene's file and of the files beside it that belong to it; LfsrError if unreadable."""
    path = Path(path)
    with system_errors(path):
        if path.suffix.lower() == ".blend":
            return _blend_content(path)
        companions = sorted(other for other in path.parent.iterdir() if other.suffix.lower() in COMPANIONS)
        return file_content(path) + "".join(f" {other.name} {stamp(other)}" for other in companions)


def stamp(path: Path) -> str:
    """Return size and time of change of a file: as good as its content, and cheap."""
    try:
        found = path.stat()
    except OSError:
        return "missing"
    return f"{found.st_size} {found.st_mtime_ns}"


def file_content(path: Path) -> str:
    """Return the digest of a file's bytes."""
    hashed = hashlib.blake2b(digest_size=16)
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            hashed.update(chunk)
    return hashed.hexdigest()


def _blend_content(path: Path) -> str:
    """Return the digest of the scene in a .blend, or of its bytes where it is compressed or of an unknown layout."""
    if not path.stat().st_size:
        return file_content(path)
    data = np.memmap(path, np.uint8, "r")
    try:
        blocks = list(_scene_blocks(data))
    except (struct.error, ValueError):
        return file_content(path)
    known = np.array([block.address for block in blocks], np.uint64)
    order = np.argsort(known, kind="stable").astype(np.uint64)
    hashed, addresses = hashlib.blake2b(digest_size=16), (known[order], order)
    for block in blocks:
        hashed.update(struct.pack("<4sqq", block.code, block.kind, block.size))
        content = data[block.start:block.start + block.size].copy()
        content[block.session] = 0
        hashed.update(_numbered(content, *addresses))
    return hashed.hexdigest()


def _scene_blocks(data: Array) -> Iterator[_Block]:
    """Yield the blocks of the scene; a DATA block belongs to the block before it."""
    wanted = False
    for block in _blocks(data):
        if block.code != DATA:
            wanted = block.code not in NOT_SCENE
        if wanted:
            yield block


def _blocks(data: Array) -> Iterator[_Block]:
    """Yield every block; ValueError or struct.error where the file is no uncompressed .blend."""
    head = data[:OLD_HEADER].tobytes()
    if head[:7] != BLEND_MAGIC:
        raise ValueError("no uncompressed .blend")
    old = head[7:8] == b"-"
    at, layout = (OLD_HEADER, OLD_BLOCK) if old else (int(head[7:9]), NEW_BLOCK)
    while True:
        fields = layout.unpack(data[at:at + layout.size].tobytes())
        code, address, at = fields[0].rstrip(b"\0"), fields[2], at + layout.size
        size, kind = (fields[1], fields[3]) if old else (fields[3], fields[1])
        if code == END:
            return
        if size < 0 or at + size > len(data):
            raise ValueError("a block goes beyond the end")
        is_id = code != DATA or data[at:at + size][NAME].tobytes() in EMBEDDED
        yield _Block(code, kind, address, at, size, (OLD_SESSION if old else NEW_SESSION) if is_id else slice(0))
        at += size


def _numbered(content: Array, addresses: Array, numbers: Array) -> bytes:
    """Return a block's bytes with each of the sorted ``addresses`` in it replaced by the number of its block."""
    whole = len(content) // 8 * 8
    words = content[:whole].view(np.uint64)
    if len(addresses):
        places = np.flatnonzero((words >= max(addresses[0], 1)) & (words <= addresses[-1]))
        found = np.searchsorted(addresses, words[places])
        known = addresses[found] == words[places]
        words[places[known]] = numbers[found[known]]
    return words.tobytes() + content[whole:].tobytes()
