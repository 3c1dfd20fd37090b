"""What scenes of others may name: regular files beside them, and nothing that never ends."""

import json
import os
import struct

import pytest

from lfsr_core.frames.scene_files import check_named_files
from tests.support.told import refuses

BUFFER = {"uri": "data.bin", "byteLength": 8}


def written(folder, content, name="scene.gltf"):
    (folder / "data.bin").write_bytes(bytes(8))
    text, path = json.dumps(content).encode(), folder / name
    if path.suffix == ".glb":
        text = struct.pack("<IIIII", 0x46546C67, 2, 20 + len(text), len(text), 0x4E4F534A) + text
    path.write_bytes(text)
    return path


def material(folder, *lines):
    (folder / "scene.mtl").write_text("\n".join(["newmtl one", *lines]))
    (folder / "scene.obj").write_text("# made\nmtllib scene.mtl\nv 0 0 0\n")
    return folder / "scene.obj"


@pytest.fixture
def special(tmp_path):
    """Names beside the scene of what is no regular file, each of another kind."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    return ["pipe", "link"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pipes and devices among files")
@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_only_regular_files_may_be_named(tmp_path, special, suffix):
    for name in special:
        for data in ({"buffers": [BUFFER | {"uri": name}]}, {"images": [{"uri": name}]}):
            refuses(f"{name}, which is no regular file", check_named_files, written(tmp_path, data, f"scene{suffix}"))
        for line in (f"map_Kd {name}", f"bump -bm 2.0 {name}", f"  MAP_ks -s 1 1 1 {name}"):
            refuses("no regular file", check_named_files, material(tmp_path, line))
    (tmp_path / "scene.obj").write_text("v 0 0 0\n")
    refuses("no regular file", check_named_files, tmp_path / "scene.obj")  # of the library beside it
    (tmp_path / "scene.mtl").unlink()
    (tmp_path / "scene.obj").write_text('mtllib "pipe"\n')
    refuses("no regular file", check_named_files, tmp_path / "scene.obj")


def test_names_are_relative_and_numbers_fit(tmp_path):
    path = written(tmp_path, {"buffers": [BUFFER]})
    with (tmp_path / "data.bin").open("wb") as file:
        file.truncate(2**24)
    refuses("has 8 bytes, but it has 16777216", check_named_files, path)
    for name in ["/dev/zero", "/etc/passwd", "file:///etc/passwd", "https://example.org/a.bin", "%2Fdev%2Fzero",
                 "file%3A%2F%2F%2Fetc%2Fpasswd", "\\\\host\\a"]:
        refuses("relative to itself", check_named_files, written(tmp_path, {"images": [{"uri": name}]}))
    for content, told in [
        ({"buffers": [BUFFER | {"byteLength": 9}]}, "9 bytes, but it has 8"),
        *(({"cameras": [{"perspective": {"yfov": angle}}]}, f"angle of view is {angle!r}")
          for angle in (0, float("nan"), "wide", 9))]:
        refuses(told, check_named_files, written(tmp_path, content))
    for content in [b"", b"{", b"[]", b"[" * 100_000, b"glTF" + bytes(3),
                                         b'{"buffers": 3, "images": [4]}',
                                         struct.pack("<IIIII", 0x46546C67, 2, 0, 2**31, 0x4E4F534A), b"\xff\xfe\0"]:
        for name in ("scene.gltf", "scene.glb", "scene.obj"):
            (tmp_path / name).write_bytes(content)
            check_named_files(tmp_path / name)


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_what_is_usual_passes(tmp_path, suffix):
    (tmp_path / "a b.png").write_bytes(b"x")
    content = {"buffers": [BUFFER, {"byteLength": 3, "uri": "data:;base64,AAAA"}, {"byteLength": 3}],
               "images": [{"uri": "a%20b.png"}, {"uri": "missing.png"}, {"bufferView": 0}],
               "cameras": [{"perspective": {"yfov": 0.7}}, {"orthographic": {"xmag": 1}}]}
    for path in (written(tmp_path, content, f"scene{suffix}"),
                 material(tmp_path, "map_Kd a b.png", "map_Bump -bm 1 missing.png", "Kd 1 1 1")):
        assert check_named_files(path) == []


def test_what_lies_outside_the_folder_is_told(tmp_path):
    (tmp_path / "beside").mkdir()
    (tmp_path / "wood.png").write_bytes(b"x")
    for path in (written(tmp_path / "beside", {"images": [{"uri": "..//wood.png"}, {"uri": "../lost.png"}]}),
                 material(tmp_path / "beside", "map_Kd " + str(tmp_path / "wood.png"), "map_Ks ../lost.png")):
        assert check_named_files(path) == [str(tmp_path / "wood.png")]
