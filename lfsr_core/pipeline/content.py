"""Digest of the scene in a file, which stays the same where Blender saves the same scene anew.

A .blend file is a list of blocks. Each has the address that it had in memory, and pointers in blocks are such
addresses. With every address replaced by the number of its block, without bytes that only the session knows, and
without the blocks of windows, brushes and other tools, two copies of one scene have the same bytes.
"""

from __future__ import annotations

import hashlib
import importlib.util
import struct
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.files import system_errors
from lfsr_core.pipeline.blend_structs import POINTER_SIZE, TOOLS, Layout, Structs

FORMAT = 3  # of the digest, which begins with it: digests of other formats are no sign of another content
BLEND_MAGIC, COMPRESSED = b"BLENDER", b"\x28\xb5\x2f\xfd"  # Zstandard's, as Blender saves by default since 5.0
OLD_HEADER, OLD_BLOCK = 12, struct.Struct("<4siQii")  # code, size, address, kind, count
NEW_BLOCK = struct.Struct("<4siQqq")  # since 5.0: code, kind, address, size, count
# Blocks of the file itself, of windows and of tools: no pixel depends on them.
NOT_SCENE = (b"GLOB", b"REND", b"TEST", b"USER", b"DNA1", b"WM", b"SN", b"SR", b"WS", b"BR", b"PL", b"PC")
DATA, END, STRUCTS = b"DATA", b"ENDB", b"DNA1"
# Bytes of a data-block's tags, users and number in the session, before and since 5.0 (DNA_ID.h).
OLD_SESSION, NEW_SESSION = slice(108, 136), slice(300, 328)
# First letters of the names of data-blocks inside others: node trees and a scene's collection.
NAME, EMBEDDED = slice(40, 42), (b"NT", b"GR")
FIRST_DATA = 1 << 32  # number of the first DATA block of a data-block; those of data-blocks begin with 1
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
            return f"{FORMAT}-{_blend_content(path)}"
        companions = sorted(other for other in path.parent.iterdir() if other.suffix.lower() in COMPANIONS)
        return f"{FORMAT}-{file_content(path)}" + "".join(f" {other.name} {stamp(other)}" for other in companions)


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
    """Return the digest of the scene in a .blend, or of its bytes where its layout or compression is unknown."""
    if not path.stat().st_size:
        return file_content(path)
    try:
        data = _decompressed(path)
        blocks = list(_blocks(data))
        [structs] = [Structs(data[block.start:block.start + block.size].tobytes())
                     for block in blocks if block.code == STRUCTS]
        layouts = {block.kind: structs.layout(block.kind) for block in blocks}
    except (struct.error, ValueError, LookupError):
        return file_content(path)
    return _digest(data, [_without_tools(data, group, layouts) for group in _of_scene(blocks)], layouts)


def _decompressed(path: Path) -> Array:
    """Return the bytes of a .blend; ValueError where it is damaged. Those of a compressed one need zstandard."""
    data: Array = np.memmap(path, np.uint8, "r")
    if data[:4].tobytes() != COMPRESSED or not importlib.util.find_spec("zstandard"):
        return data
    import zstandard

    try:
        with path.open("rb") as file:
            whole = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)
            return np.frombuffer(whole.read(), np.uint8)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None


def _digest(data: Array, groups: list[list[_Block]], layouts: Mapping[int, Layout | None]) -> str:
    """Return the digest of data-blocks, each a list of the block that names it and of the DATA blocks behind."""
    hashed, named = hashlib.blake2b(digest_size=16), _Numbers.of([group[0].address for group in groups], 1)
    for group in groups:
        # The address of a DATA block may be that of another one in another data-block.
        numbers = (_Numbers.of([block.address for block in group[1:]], FIRST_DATA), named)
        for block in group:
            hashed.update(struct.pack("<4sqq", block.code, block.kind, block.size))
            content = data[block.start:block.start + block.size].copy()
            content[block.session] = 0
            layout = _fitting(layouts, block)
            hashed.update(_meaning(content.reshape(-1, layout.size), layout, numbers) if layout else
                          _numbered(content, numbers))
    return hashed.hexdigest()


def _fitting(layouts: Mapping[int, Layout | None], block: _Block) -> Layout | None:
    """Return the layout of the structs in a block, None for plain numbers."""
    layout = layouts[block.kind]
    return layout if layout and layout.size and block.size % layout.size == 0 else None


def _of_scene(blocks: Iterable[_Block]) -> list[list[_Block]]:
    """Return the data-blocks of the scene; a DATA block belongs to the block before it."""
    groups: list[list[_Block]] = [[]]
    for block in blocks:
        if block.code != DATA:
            groups.append([])
        groups[-1].append(block)
    return [group for group in groups[1:] if group[0].code not in NOT_SCENE]


def _without_tools(data: Array, group: list[_Block], layouts: Mapping[int, Layout | None]) -> list[_Block]:
    """Return the blocks of a data-block but those of TOOLS, and the DATA blocks that these point at."""
    waiting = [block for block in group[1:] if (layout := layouts[block.kind]) and layout.name in TOOLS]
    by_address = {block.address: block for block in group[1:]} if waiting else {}
    tools = set()
    while waiting:
        block = waiting.pop()
        tools.add(block.start)
        if layout := _fitting(layouts, block):
            words = _words(data[block.start:block.start + block.size].reshape(-1, layout.size), layout)
            found = (by_address.get(int(address)) for address in words.ravel())
            waiting += [other for other in found if other and other.start not in tools]
    return [block for block in group if block.start not in tools]


def _blocks(data: Array) -> Iterator[_Block]:
    """Yield every block; ValueError or struct.error where the file is no uncompressed .blend."""
    head = data[:OLD_HEADER].tobytes()
    if head[:7] != BLEND_MAGIC:
        raise ValueError("no .blend, or a compressed one")
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


class _Numbers(NamedTuple):
    """Sorted addresses of blocks, and their numbers."""

    addresses: Array
    numbers: Array

    @classmethod
    def of(cls, addresses: list[int], first: int) -> _Numbers:
        """``first``: number of the first address."""
        known = np.array(addresses, np.uint64)
        order = np.argsort(known, kind="stable")
        return cls(known[order], order.astype(np.uint64) + np.uint64(first))

    def replaced(self, words: Array) -> tuple[Array, Array]:
        """Return the numbers of those of the ``words`` that are addresses, and which are."""
        if not len(self.addresses):
            return words, np.zeros(words.shape, bool)
        found = np.minimum(np.searchsorted(self.addresses, words), len(self.addresses) - 1)
        return self.numbers[found], (self.addresses[found] == words) & (words > 0)


def _meaning(rows: Array, layout: Layout, known: Iterable[_Numbers]) -> bytes:
    """Return the bytes of structs, one in each of the ``rows``, without what says nothing about the scene.

    A pointer is the number of the block that it points at, 0 where that is not in the file.
    """
    rows[:, layout.noise] = 0
    for text in layout.texts:
        part = rows[:, text]
        part[np.logical_or.accumulate(part == 0, axis=1)] = 0
    if len(layout.pointers):
        words = _words(rows, layout)
        result = np.zeros_like(words)
        for each in known:
            numbers, fits = each.replaced(words)
            result = np.where(fits & (result == 0), numbers, result)
        rows[:, layout.pointers] = result.view(np.uint8)
    return rows.tobytes()


def _words(rows: Array, layout: Layout) -> Array:
    """Pointers (rows, n) uint64 of structs."""
    return np.ascontiguousarray(rows[:, layout.pointers]).view(np.uint64)


def _numbered(content: Array, known: Iterable[_Numbers]) -> bytes:
    """Return a block's bytes with each address in it replaced by the number of its block."""
    whole = len(content) // POINTER_SIZE * POINTER_SIZE
    words = content[:whole].view(np.uint64)
    before = words.copy()
    for each in known:
        numbers, fits = each.replaced(before)
        words[fits & (words == before)] = numbers[fits & (words == before)]
    return words.tobytes() + content[whole:].tobytes()
