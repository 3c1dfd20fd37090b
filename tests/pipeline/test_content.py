"""What is in a scene's file: changed by what it shows, not by when or where it was saved."""

from __future__ import annotations

import shutil
import struct
import tempfile
from pathlib import Path

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.errors import LfsrError
from lfsr_core.pipeline.content import FORMAT, scene_content

TYPES = {"raw_data": 0, "char": 1, "int": 4, "void": 0, "Window": 16, "Thing": 88, "ToolSettings": 8, "Pair": 16}
STRUCTS = {"raw_data": [], "Window": [("void", "*target"), ("int", "state[2]")],
           "Pair": [("Thing", "*other"), ("int", "number"), ("char", "_pad[4]")],
           "Thing": [("Pair", "pair"), ("void", "*(*call)()"), ("Pair", "*more[2]"), ("ToolSettings", "*tools"),
                     ("char", "path[40]")],
           "ToolSettings": [("Thing", "*last")]}


def declaration() -> bytes:
    """The block DNA1, which lists TYPES and STRUCTS."""
    names = list(dict.fromkeys(name for members in STRUCTS.values() for _, name in members))
    types, data = list(TYPES), b"SDNA"
    for code, texts in ((b"NAME", names), (b"TYPE", types)):
        data += code + struct.pack("<i", len(texts)) + b"".join(text.encode() + b"\0" for text in texts)
        data += bytes(-len(data) % 4)
    data += b"TLEN" + struct.pack(f"<{len(types)}H", *TYPES.values())
    data += bytes(-len(data) % 4) + b"STRC" + struct.pack("<i", len(STRUCTS))
    for kind, members in STRUCTS.items():
        data += struct.pack("<HH", types.index(kind), len(members))
        data += b"".join(struct.pack("<HH", types.index(a), names.index(b)) for a, b in members)
    return data


def blend(path, blocks, new=True):
    """A .blend of (code, address, struct, content) blocks, in the layout before or since 5.0."""
    data = b"BLENDER17-01v0500" if new else b"BLENDER-v405"
    end = [(b"DNA1", 1, "raw_data", declaration()), (b"ENDB", 0, "raw_data", b"")]
    for code, address, kind, content in [*blocks, *end]:
        size, number = len(content), list(STRUCTS).index(kind)
        data += struct.pack("<4siQqq", code, number, address, size, 1) if new else \
            struct.pack("<4siQii", code, size, address, number, 1)
        data += content
    path.write_bytes(data)
    return scene_content(path)


def pair(other=0, number=5, pad=b"\0" * 4):
    return struct.pack("<Qi4s", other, number, pad)


def scene(base, number=5, window=1, runtime=1, pad=b"\0" * 4, path=b"a.png", tool=0):
    """A thing with data and tools, loaded at address ``base``, whose pair points at another thing; and a window."""
    def thing(to, more, tools):
        return pair(to, number, pad) + struct.pack("<4Q", runtime, *more, tools) + path.ljust(40, b"\0")

    # Data of different data-blocks may have the same address.
    return [(b"WM", base + 900, "Window", struct.pack("<Qii", base + 100, window, 0)),
            (b"DATA", base + 950, "raw_data", bytes([window] * 8)),
            (b"OB", base + 100, "Thing", thing(base + 300, (base + 200, 0), base + 400)),
            (b"DATA", base + 200, "Pair", pair(base + 100, 1) + pair(base + 300, 2)),
            (b"DATA", base + 210, "raw_data", b"thirteen bytes"),
            (b"DATA", base + 400, "ToolSettings", struct.pack("<Q", tool)),
            (b"OB", base + 300, "Thing", thing(0, (0, base + 200), 0)), (b"DATA", base + 200, "Pair", pair(0, 9))]


BASE = 10**12
SAME = [{"window": 9}, {"runtime": 77}, {"pad": b"junk"}, {"path": b"a.png\0and what was here before"}, {"tool": BASE}]


@pytest.mark.parametrize("new", [False, True])
@pytest.mark.parametrize("changes", SAME)
def test_what_only_a_session_knows_does_not_count(tmp_path, new, changes):
    first = blend(tmp_path / "a.blend", scene(BASE), new)
    assert blend(tmp_path / "b.blend", scene(7 * 10**11, **changes), new) == first
    assert first.startswith(f"{FORMAT}-")


@pytest.mark.parametrize("new", [False, True])
@pytest.mark.parametrize("changes", [{"number": 6}, {"path": b"b.png"}])
def test_what_the_scene_holds_counts(tmp_path, new, changes):
    assert blend(tmp_path / "a.blend", scene(BASE), new) != blend(tmp_path / "b.blend", scene(BASE, **changes), new)


@pytest.mark.parametrize(("block", "content"), [
    (2, pair(BASE + 100) + struct.pack("<4Q", 1, BASE + 200, 0, BASE + 400) + b"a.png".ljust(40, b"\0")),
    (2, pair(0) + struct.pack("<4Q", 1, BASE + 200, 0, BASE + 400) + b"a.png".ljust(40, b"\0")),
    (3, pair(BASE + 300, 1) + pair(BASE + 300, 2)), (3, pair(BASE + 100, 1)), (4, b"fourteen bytes")])
def test_pointers_and_plain_data_count(tmp_path, block, content):
    first, other = scene(BASE), scene(BASE)
    other[block] = (*other[block][:3], content)
    assert blend(tmp_path / "a.blend", first) != blend(tmp_path / "b.blend", other)


def test_a_compressed_file_is_known_as_it_is_without_compression(tmp_path):
    first = blend(tmp_path / "a.blend", scene(BASE))
    data = (tmp_path / "a.blend").read_bytes()
    pieces = [zstandard.compress(data[:500]), zstandard.compress(data[500:])]  # Blender writes many
    (tmp_path / "b.blend").write_bytes(b"".join(pieces))
    assert scene_content(tmp_path / "b.blend") == first
    (tmp_path / "c.blend").write_bytes(pieces[0] + pieces[1][:-9])
    assert scene_content(tmp_path / "c.blend") != first


@given(st.integers(0, 10**6), st.binary(min_size=1, max_size=6))
def test_a_damaged_declaration_is_no_error(place, piece):
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "a.blend")
        blend(path, scene(BASE))
        data = bytearray(path.read_bytes())
        at = data.index(b"SDNA") + place % len(declaration())
        data[at:at + len(piece)] = piece
        path.write_bytes(data)
        assert scene_content(path).startswith(f"{FORMAT}-")


@pytest.mark.parametrize("content", [b"", b"BLENDER", b"BLENDER17-01v0500", b"BLENDER-v405" + bytes(200),
                                     b"BLENDER_v249", b"\x28\xb5\x2f\xfd compressed"])
def test_what_is_no_plain_blend_counts_byte_by_byte(tmp_path, content):
    (tmp_path / "a.blend").write_bytes(content)
    (tmp_path / "b.blend").write_bytes(content + b" ")
    first = scene_content(tmp_path / "a.blend")
    assert first == scene_content(tmp_path / "a.blend") != scene_content(tmp_path / "b.blend")


def test_files_beside_a_gltf_count_too(tmp_path):
    (tmp_path / "a.gltf").write_text("{}")
    alone = scene_content(tmp_path / "a.gltf")
    (tmp_path / "a.bin").write_bytes(b"1")
    assert scene_content(tmp_path / "a.gltf") != alone
    (tmp_path / "notes.txt").write_text("x")
    shutil.rmtree(tmp_path / "frame", ignore_errors=True)
    with_bin = scene_content(tmp_path / "a.gltf")
    (tmp_path / "frame").mkdir()
    assert scene_content(tmp_path / "a.gltf") == with_bin


def test_a_file_that_is_not_there_is_one_sentence(tmp_path):
    with pytest.raises(LfsrError, match="a.blend cannot be"):
        scene_content(tmp_path / "a.blend")
