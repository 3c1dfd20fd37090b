"""Folders of a scene's images, what they hold already, and whose that is."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import check_name, is_forbidden, read_json, write_json
from lfsr_core.frames.folder import FrameFolder, is_of
from lfsr_core.frames.frame import EIA_FILE, FRAME_FILE, PANEL_FILE

from .words import DIRECT

UNSAVED = "untitled"
PROBE_BYTES = 1 << 20


def absolute(path: str, what: str) -> Path:
    """Absolute path of a Blender path; LfsrError if it is relative to a file that was never saved."""
    if path.startswith("//") and not bpy.data.filepath:
        raise LfsrError(f"{what} is {path!r}, beside the .blend file, but this file is not saved yet: "
                        "save it or choose another folder")
    return Path(bpy.path.abspath(path)).absolute()


def file_stem() -> str:
    """Name of the open file without its suffix."""
    return Path(bpy.data.filepath).stem or UNSAVED


def scene_folder(scene: bpy.types.Scene) -> Path:
    """Folder of this scene's frames; each scene of each file has its own. LfsrError where it cannot exist."""
    output = (_unsaved(scene) if waits_for_saving(scene) else
              absolute(scene.lfsr.output or "//", "the output folder"))
    folder = output / _clean(file_stem()) / _clean(scene.name_full)
    check_name(folder)
    return folder


def try_output(scene: bpy.types.Scene) -> None:
    """LfsrError where this scene's folder cannot be made or written to, which is found out by writing."""
    folder = scene_folder(scene)
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(PROBE_BYTES))
    except OSError as error:
        raise LfsrError(f"images cannot be written to {folder} ({error.strerror}): free some space there, or choose "
                        "another output folder") from None
    finally:
        for path in missing:
            with contextlib.suppress(OSError):
                path.rmdir()


def frame_folder(scene: bpy.types.Scene, number: int | None = None) -> Path:
    """Frame folder of frame ``number``, by default the current one."""
    return scene_folder(scene) / f"{scene.frame_current if number is None else number:04d}"


def source_of(scene: bpy.types.Scene) -> str:
    """The open file as frames of ``scene`` name it: as seen from their folders, so that both can move together.

    A file that was never saved has a name that no other file and no later session has.
    """
    if not bpy.data.filepath:
        return f"{UNSAVED} {Path(bpy.app.tempdir).name} {scene.session_uid}"
    with contextlib.suppress(ValueError):  # on another drive
        return Path(os.path.relpath(bpy.data.filepath, frame_folder(scene))).as_posix()
    return bpy.data.filepath


def is_own(scene: bpy.types.Scene, folder: Path) -> bool:
    """False if the frame in ``folder`` is known to be of another file or scene."""
    return is_of(FrameFolder(folder).readable, source_of(scene), scene.name_full)


def first_foreign(scene: bpy.types.Scene, frames: Iterable[int]) -> str:
    """Return a sentence on the first of ``frames`` whose folder has the image of another file or scene, else ""."""
    folders = (frame_folder(scene, number) for number in frames)
    return next((_foreign(folder) for folder in folders if not is_own(scene, folder)), "")


def is_unfinished(folder: Path) -> bool:
    """True if ``folder`` holds a render of which the second stage made no image."""
    return FrameFolder(folder).holds() and not any((folder / name).is_file() for name in (EIA_FILE, PANEL_FILE))


def finished_frame(scene: bpy.types.Scene, purpose: str) -> Path:
    """Frame folder of the current frame; LfsrError where it has no image of a light field of this scene.

    ``purpose``: for the error, as in "to preview".
    """
    folder = shown_frame(scene, purpose)
    if not (folder / EIA_FILE).is_file():
        raise LfsrError(f"the image in {folder} was made by {DIRECT} and has no views {purpose}: switch that off under "
                        "Quality, Advanced, and render the EIA again")
    return folder


def shown_frame(scene: bpy.types.Scene, purpose: str) -> Path:
    """Frame folder of the current frame; LfsrError where it has no image of this scene for the panel."""
    folder = frame_folder(scene)
    if not is_own(scene, folder):
        raise LfsrError(f"{_foreign(folder)}: render the EIA first, or choose another output folder")
    if not any((folder / name).is_file() for name in (EIA_FILE, PANEL_FILE)):
        raise LfsrError(f"there is no image in {folder} {purpose}: render the EIA first")
    return folder


def _clean(name: str) -> str:
    """Name of a folder: letters of any language stay, which `bpy.path.clean_name` replaces."""
    cleaned = re.sub(r"[^\w.-]+", "_", name).rstrip(".") or "_"
    return f"_{cleaned}" if is_forbidden(cleaned) else cleaned


def waits_for_saving(scene: bpy.types.Scene) -> bool:
    """True if images are among Blender's temporary files: they belong beside a file that was never saved.

    A script has to say where they belong, since they would be gone at its end.
    """
    return not bpy.data.filepath and (scene.lfsr.output or "//").startswith("//") and not bpy.app.background


def move_saved(scene: bpy.types.Scene) -> None:
    """Move what was rendered before the file was first saved to its place beside the file, if that is free."""
    older, folder = _unsaved(scene) / UNSAVED / _clean(scene.name_full), scene_folder(scene)
    if not older.is_dir() or folder.exists():
        return
    folder.mkdir(parents=True)
    for path in (path for path in older.iterdir() if not path.name.startswith(".")):  # those are at work
        moved = Path(shutil.move(path, folder))
        if (moved / FRAME_FILE).is_file():
            write_json(moved / FRAME_FILE, read_json(moved / FRAME_FILE, "a frame") | {"source": source_of(scene)})
    for image in bpy.data.images:
        path = Path(bpy.path.abspath(image.filepath)).resolve()  # Blender makes it relative as it saves
        if path.is_relative_to(older.resolve()):
            image.filepath = str(folder / path.relative_to(older.resolve()))
    state = bpy.context.window_manager.lfsr
    if Path(state.outcome_folder).is_relative_to(older):
        state.outcome_folder = str(folder / Path(state.outcome_folder).relative_to(older))


def _unsaved(scene: bpy.types.Scene) -> Path:
    return Path(bpy.app.tempdir, f"lfsr-unsaved-{scene.session_uid}")


def _foreign(folder: Path) -> str:
    """A sentence on whose image ``folder`` holds."""
    frame = FrameFolder(folder).part
    file = frame.scene
    if frame.source:
        path = Path(os.path.normpath(folder / frame.source))
        is_unsaved = frame.source.startswith(f"{UNSAVED} ")
        file = "a file that was never saved" if is_unsaved else f"{path.name} in the folder {path.parent.name}"
    return (f"frame {folder.name} in the output folder is an image of another scene, "
            f"{frame.scene_name or folder.parent.name!r} of {file}")
