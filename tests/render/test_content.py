"""What is in a scene's file: changed by what it shows, not by when or where it was saved."""

from __future__ import annotations

import shutil
import struct

import pytest

from lfsr_core.errors import LfsrError
from lfsr_core.render.content import scene_content


def blend(path, blocks, new=True):
    """A .blend of (code, address, content) blocks, in the layout before or since 5.0."""
    data = b"BLENDER17-01v0500" if new else b"BLENDER-v405"
    for code, address, content in [*blocks, (b"ENDB", 0, b"")]:
        size = len(content)
        data += struct.pack("<4siQqq", code, 3, address, size, 1) if new else \
            struct.pack("<4siQii", code, size, address, 3, 1)
        data += content
    path.write_bytes(data)
    return scene_content(path)


def scene(base, light=5, window=1):
    """A scene whose object points at its mesh, loaded at address ``base``; a window that looks at it."""
    return [(b"WM", base + 900, struct.pack("<QQ", base + 100, window)), (b"DATA", base + 950, bytes([window] * 8)),
            (b"OB", base + 100, struct.pack("<QQ", base + 200, light)), (b"DATA", base + 200, b"twelve bytes"),
            (b"ME", base + 300, struct.pack("<Qi", base + 100, 7))]


@pytest.mark.parametrize("new", [False, True])
def test_addresses_and_windows_do_not_count_but_the_scene_does(tmp_path, new):
    first = blend(tmp_path / "a.blend", scene(10**12), new)
    assert blend(tmp_path / "b.blend", scene(7 * 10**11, window=9), new) == first
    assert blend(tmp_path / "c.blend", scene(10**12, light=6), new) != first
    other = scene(10**12)
    other[2] = (b"OB", 10**12 + 100, struct.pack("<QQ", 10**12 + 300, 5))
    assert blend(tmp_path / "d.blend", other, new) != first, "it points at another block"


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
