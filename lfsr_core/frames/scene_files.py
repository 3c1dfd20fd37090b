"""The files that a glTF or OBJ scene names, looked at before Blender opens them.

A scene of somebody else may name anything: a device that never ends, a pipe, a file that has nothing to do with it.
glTF 2.0, section 3.6.1.1: names are relative to the scene; OBJ names material libraries, which name images.
"""

import contextlib
import json
import math
import os
import re
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError

MOST_TEXT = 2**28  # bytes of a glTF's JSON, or of a material library
SPARE = 2**20  # bytes by which a buffer may be larger than its scene says
GLB, JSON_CHUNK = 0x46546C67, 0x4E4F534A
MAPS = re.compile(rb"\s*(?:map_\w+|bump|disp|decal|refl|norm)\s+(.+)", re.IGNORECASE)
ABSOLUTE = re.compile(r"[\\/]|[A-Za-z][A-Za-z0-9+.-]*:")  # a path from the root, or a scheme or drive
ESCAPED = re.compile(rb"%([0-9A-Fa-f]{2})")  # a byte of a URI
LIBRARY = re.compile(rb"\s*mtllib\s+(.+)", re.IGNORECASE)


def check_named_files(scene: str | Path) -> list[str]:
    """Return the files outside the folder of a .gltf, .glb or .obj that it names.

    LfsrError where a glTF's name is absolute, a file is not regular or has the wrong size, or a camera's angle is
    impossible. Blender itself reports missing files, and a scene that is no glTF.
    """
    path, named = Path(scene), list[Path]()
    if path.suffix.lower() in (".gltf", ".glb"):
        named += _check_gltf(path)
    elif path.suffix.lower() == ".obj":
        # Blender reads the library of the scene's own name too, named or not.
        for library in (path.parent / name for name in (path.with_suffix(".mtl").name, *_named(path, LIBRARY))):
            check_regular(path, library)
            named.append(library)
            if library.is_file():
                # Options such as "-s 1 1 1" stand before the name, which may have blanks.
                named += {path.parent / image for name in _named(library, MAPS) for image in (name, name.split()[-1])}
    for file in named:
        check_regular(path, file)
    home = os.path.abspath(path.parent)
    outside = {os.path.abspath(file) for file in named if file.exists()}
    return sorted(file for file in outside if not file.startswith(os.path.join(home, "")))


def check_regular(scene: str | Path, named: str | Path) -> None:
    """LfsrError where ``named`` is there, but neither a regular file nor a folder: a device or a pipe."""
    if os.path.exists(named) and not (os.path.isfile(named) or os.path.isdir(named)):
        raise LfsrError(f"scene {scene} names {named}, which is no regular file: correct the name in the scene")


def _check_gltf(path: Path) -> Iterator[Path]:
    """Yield the files that a .gltf or .glb names."""
    content: Any = None
    with path.open("rb") as scene:
        head, size, chunk = scene.read(20), MOST_TEXT, JSON_CHUNK
        if len(head) == 20 and struct.unpack_from("<I", head)[0] == GLB:
            size, chunk = struct.unpack_from("<II", head, 12)
        else:
            scene.seek(0)
        with contextlib.suppress(ValueError, RecursionError):
            content = json.loads(scene.read(min(size, MOST_TEXT))) if chunk == JSON_CHUNK else None
    if not isinstance(content, dict):
        return
    for kind in ("buffers", "images"):
        for entry in _records(content.get(kind)):
            name = entry.get("uri")
            if not isinstance(name, str) or name.startswith("data:"):
                continue
            plain = ESCAPED.sub(lambda escape: bytes([int(escape[1], 16)]), os.fsencode(name.replace("\\", "/")))
            if ABSOLUTE.match(name) or ABSOLUTE.match(os.fsdecode(plain)):
                raise LfsrError(f"scene {path} names {name[:200]}, but a glTF may name only files relative to itself: "
                                "put the file beside the scene and correct the name")
            file = path.parent / os.fsdecode(plain)
            yield file
            told = entry.get("byteLength")
            if kind == "buffers" and isinstance(told, int) and file.is_file():
                size = file.stat().st_size
                if not told <= size <= 2 * told + SPARE:
                    raise LfsrError(f"scene {path} says that {name[:200]} has {told} bytes, but it has {size}: "
                                    "export the scene again")
    for camera in _records(content.get("cameras")):
        lens = camera.get("perspective")
        angle = lens.get("yfov") if isinstance(lens, dict) else None
        if angle is not None and not (isinstance(angle, int | float) and 0 < angle < math.pi):
            raise LfsrError(f"scene {path} has a camera whose angle of view is {angle!r:.40} radians, but it must be "
                            "between 0 and π: correct the camera")


def _records(value: Any) -> Iterable[dict[str, Any]]:
    return [entry for entry in value if isinstance(entry, dict)] if isinstance(value, list) else []


def _named(path: Path, pattern: re.Pattern[bytes]) -> Iterator[str]:
    """Yield the names that lines of a regular file give."""
    with path.open("rb") as file:
        while line := file.readline(2**16):
            if match := pattern.match(line):
                yield os.fsdecode(match[1].strip(b" \t\r\n\"").replace(b"\\", b"/"))
