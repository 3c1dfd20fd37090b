"""The structs of a .blend file: which of their bytes are pointers, text, and nothing that a scene depends on.

The block DNA1 lists every struct with the types and names of its members
(https://projects.blender.org/blender/blender, source/blender/blenloader and makesdna).
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
import struct
from collections.abc import Iterator

import numpy as np

from lfsr_core.base.arrays import Array

POINTER_SIZE, SHORTEST_TEXT = 8, 32  # bytes; shorter arrays of char may be numbers
# Members that change from save to save, or with what is shown on the screen, in any struct and in one.
NOISE = re.compile(r"_pad\w*|runtime|session_uid|changed_timestamp")
NOISE_OF = {"Scene": ("customdata_mask", "customdata_mask_modal", "cursor"), "Mesh": ("face_sets_color_seed",),
            "Object": ("mode", "base_flag"), "Base": ("flag",), "ViewLayer": ("basact", "active_collection"),
            "bNodeSocket": ("flag",)}
TOOLS = ("ToolSettings", "PreviewImage")  # structs of no scene, as is what only they point at
MOST_BYTES, DEEPEST = 65535, 30  # of a struct, and structs one inside the other
RAW = 0  # number of the struct of blocks that hold plain numbers


@dataclasses.dataclass(frozen=True)
class Layout:
    """A struct of ``size`` bytes."""

    name: str
    size: int
    # offsets of the bytes of pointers, and of those that say nothing about the scene
    pointers: Array
    noise: Array
    texts: tuple[slice, ...]  # bytes of texts, which end at the first 0


@dataclasses.dataclass(frozen=True)
class _Member:
    kind: str  # name of its type
    name: str
    counts: tuple[int, ...]  # of an array, along its axes
    is_pointer: bool


class Structs:
    """The structs that a file declares; ValueError, IndexError or struct.error where the declaration is damaged."""

    def __init__(self, data: bytes) -> None:
        """``data``: content of the block DNA1."""
        names, at = _texts(data, data.index(b"NAME"))
        self._types, at = _texts(data, data.index(b"TYPE", at))
        at = data.index(b"TLEN", at) + 4
        self._sizes = dict(zip(self._types, struct.unpack_from(f"<{len(self._types)}H", data, at), strict=True))
        at = data.index(b"STRC", at + 2 * len(self._types)) + 4
        numbers = struct.unpack_from(f"<{(len(data) - at) // 2}H", data, at)
        self._members: dict[str, list[_Member]] = {}
        place = 2  # after their count, a whole number of four bytes
        for _ in range(numbers[0] + 65536 * numbers[1]):
            kind, count = numbers[place:place + 2]
            pairs = numbers[place + 2:place + 2 + 2 * count]
            self._members[self._types[kind]] = [_member(self._types[a], names[b])
                                                for a, b in zip(pairs[::2], pairs[1::2], strict=True)]
            place += 2 + 2 * count
        self._names = list(self._members)
        self.layout = functools.cache(self._layout)

    def _layout(self, number: int) -> Layout | None:
        """Layout of the struct of a block, None for plain numbers."""
        if number == RAW:
            return None
        name = self._names[number]
        pointers: list[int] = []
        noise: list[int] = []
        texts, end = [], 0
        for member, start, size, owner in self._flat(name, 0):
            end = start + size
            if NOISE.fullmatch(member.name) or member.name in NOISE_OF.get(owner, ()):
                noise += range(start, start + size)
            elif member.is_pointer:
                pointers += range(start, start + size)
            elif member.kind == "char" and member.counts and member.counts[-1] >= SHORTEST_TEXT:
                longest = member.counts[-1]
                texts += [slice(at, at + longest) for at in range(start, start + size, longest)]
        if end != self._sizes[name]:
            raise ValueError(f"the members of {name} have {end} bytes, but it has {self._sizes[name]}")
        return Layout(name, self._sizes[name], np.array(pointers, int), np.array(noise, int), tuple(texts))

    def _flat(self, name: str, start: int, depth: int = 0) -> Iterator[tuple[_Member, int, int, str]]:
        """Yield members with their offset, size and struct; those of a struct inside a struct instead of it."""
        if depth > DEEPEST or not self._sizes[name]:
            raise ValueError(f"the struct {name} is empty or inside itself")
        for member in self._members[name]:
            size = POINTER_SIZE if member.is_pointer else self._sizes[member.kind]
            count = math.prod(member.counts)
            if start + size * count > MOST_BYTES or count > MOST_BYTES:
                raise ValueError(f"the struct {name} is too large")
            if member.is_pointer or member.kind not in self._members or NOISE.fullmatch(member.name) or (
                    member.name in NOISE_OF.get(name, ())):
                yield member, start, size * count, name
            else:
                for index in range(count):
                    yield from self._flat(member.kind, start + index * size, depth + 1)
            start += size * count


def _member(kind: str, text: str) -> _Member:
    """``text``: as in C, with stars before the name and counts behind it."""
    name = re.search(r"\w+", text)
    if name is None:
        raise ValueError("a member without a name")
    return _Member(kind, name[0], tuple(map(int, re.findall(r"\[(\d+)\]", text))), text.startswith(("*", "(")))


def _texts(data: bytes, at: int) -> tuple[list[str], int]:
    """The texts of a list that begins at ``at`` with four letters and their number, and its end."""
    (count,) = struct.unpack_from("<i", data, at + 4)
    texts = data[at + 8:].split(b"\0", count)[:count]
    return [text.decode("ascii") for text in texts], at + 8 + sum(map(len, texts)) + count
