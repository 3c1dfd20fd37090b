"""Images of a file that has another name now: they lie in a folder of its old name."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, system_errors, write_json
from lfsr_core.frames.frame import FRAME_FILE

from . import folders


def former(scene: bpy.types.Scene) -> tuple[Path, str] | None:
    """Folder of images of a file that lay beside this one and is gone, and its name.

    None where there is no such file or more than one, or where this file has images of its own.
    """
    folder = folders.scene_folder(scene)
    if not bpy.data.filepath or folder.exists():
        return None
    found = [(path, name) for path in folder.parents[1].glob(f"*/{folder.name}") if (name := _gone(path))]
    return found[0] if len(found) == 1 else None


def take_over(scene: bpy.types.Scene) -> None:
    """Make the images of ``former`` those of this file; LfsrError where there are none or they cannot be moved."""
    found, folder = former(scene), folders.scene_folder(scene)
    if found is None:
        raise LfsrError("the images of the renamed file are not there any more: check the scene again")
    with system_errors(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        found[0].rename(folder)
    for path in folder.glob(f"*/{FRAME_FILE}"):
        write_json(path, read_json(path, "a frame") | {"source": folders.source_of(scene)})
    with contextlib.suppress(OSError):  # other scenes stay
        found[0].parent.rmdir()


def _gone(folder: Path) -> str:
    """Name of the file whose frames ``folder`` holds where it lay beside the open file and is gone, else ""."""
    first = next((path.parent for path in sorted(folder.glob(f"*/{FRAME_FILE}"))), None)
    frame = folders.frame_in(first) if first else None
    if first is None or frame is None or not frame.source:
        return ""
    source = Path(os.path.normpath(first / frame.source))
    return source.name if source.parent == Path(bpy.data.filepath).parent and not source.exists() else ""
