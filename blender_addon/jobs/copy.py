"""The copy of the open file that a render uses. It lies beside the render's stored parts until the image is published.

After a render that ended early the copy is used again if the scene was not edited since, saved or not, and the parts
with it. Edits are counted while the file is open; the scene of a file that was opened has the stamp of that file.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import file_stamp, read_json, write_json
from lfsr_core.frames.folder import FrameFolder, digest
from lfsr_core.pipeline.staging import has_parts

from ..scene import folders
from ..scene.open import collections
from ..scene.overrides import preferred
from . import show_image

COPY_FOLDER, RECORD = "copy", "names.json"  # in the folder of the parts, and in that of the copy
# A request names its frame; whether a compositor is used decides nothing.
FREE = ("frame_current", "frame_current_final", "frame_float", "frame_subframe", "use_nodes")
_numbers, _session = itertools.count(), secrets.token_hex(8)


@dataclasses.dataclass
class _State:
    """The scene between two edits."""

    names: set[str] = dataclasses.field(default_factory=lambda: {f"{_session} {next(_numbers)}"})  # with files' stamps
    time: int = dataclasses.field(default_factory=time.time_ns)  # of the edit before
    unreported: str = ""  # digest of ``_unreported``, empty where nobody has looked yet
    records: list[Path] = dataclasses.field(default_factory=list)  # of copies of it
    is_opening: bool = False


_last = _State()


@contextlib.contextmanager
def file_copy(output: Path | None = None) -> Iterator[Path]:
    """Yield a copy of the .blend as it is now, unsaved changes included.

    Without ``output``, the folder of a frame or of an animation's frames, it is temporary. Else it stays after a block
    that ends early, if the render has left parts. Saving stops Blender for as long as it takes: yield SAVING before.
    """
    kept = FrameFolder(output).parts / COPY_FOLDER if output else None
    try:
        if kept:
            kept.mkdir(parents=True, exist_ok=True)
    except OSError:  # no place beside the output
        kept = None
    folder = kept or Path(tempfile.mkdtemp(prefix="lfsr-", dir=bpy.app.tempdir or None))
    stays = False
    try:
        yield _kept_copy(folder) if kept else save_copy(folder / f"{folders.file_stem()}.blend")
    except BaseException:
        stays = bool(kept and output and any(map(has_parts, (kept.parent, *output.glob(".*-parts")))))
        raise
    finally:
        if not stays:
            shutil.rmtree(folder, ignore_errors=True)
        if kept:
            with contextlib.suppress(OSError):
                kept.parent.rmdir()  # if it is empty


def save_copy(path: Path) -> Path:
    """Save the file as it is now as ``path``, stay in the open one, and return the path; LfsrError where that fails."""
    try:
        # Without the picture for file browsers, which would be rendered.
        with show_image.wait_cursor(), preferred("filepaths", file_preview_type="NONE"):
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, check_existing=False, compress=False)
    except RuntimeError as error:
        raise LfsrError(f"a copy of this file cannot be saved to {path.parent} ({str(error).strip()}): "
                        "free some space there") from None
    return path


def _kept_copy(folder: Path) -> Path:
    """Return the copy in ``folder``, saved anew unless it is of the scene as it is now."""
    state, path, record = _state(), folder / f"{folders.file_stem()}.blend", folder / RECORD
    try:
        is_same = path.is_file() and not state.names.isdisjoint(read_json(record, "the names of a copy"))
    except (LfsrError, TypeError):
        is_same = False
    if not is_same:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
        save_copy(path)
        os.utime(path, ns=(state.time, state.time))  # copies of one state have one stamp
    write_json(record, sorted(state.names))
    state.records.append(record)
    return path


def _state() -> _State:
    """Return the state of the scene now."""
    bpy.context.view_layer.update()  # reports the last edits
    unreported = digest(_unreported())
    if _last.unreported not in ("", unreported) or _updated not in bpy.app.handlers.depsgraph_update_post:
        _edited()
    _last.unreported = unreported
    return _last


def _unreported() -> list[Any]:
    """Return what may decide pixels of a render and can change without a report to ``_updated``."""
    layers = [(scene, layer) for scene in bpy.data.scenes for layer in scene.view_layers]
    owners = [owner for scene in bpy.data.scenes
              for owner in (scene, scene.render, scene.view_settings, getattr(scene, "cycles", None))]
    owners += [owner for _, layer in layers for owner in (layer, getattr(layer, "cycles", None))]
    owners += [each for _, layer in layers
               for each in (layer.layer_collection, *collections(layer.layer_collection))]
    used = bpy.data.user_map(key_types={"IMAGE"}, value_types={"MATERIAL", "WORLD", "LIGHT", "NODETREE", "TEXTURE"})
    images = [[image.name_full, image.source, image.filepath, image.alpha_mode, image.colorspace_settings.name]
              for image, users in used.items() if users]
    markers = [[marker.frame, marker.camera and marker.camera.name_full]
               for scene in bpy.data.scenes for marker in scene.timeline_markers]
    return [[_values(owner) for owner in owners if owner is not None], sorted(images), markers]


def _values(owner: Any) -> list[str]:
    """Return the properties of ``owner``, with names in place of data-blocks."""
    found = []
    for item in owner.bl_rna.properties:
        if item.identifier in FREE or item.type == "COLLECTION":
            continue
        value = getattr(owner, item.identifier)
        if item.type == "POINTER":
            value = getattr(value, "name_full", "")
        elif isinstance(value, set):
            value = sorted(value)
        elif getattr(item, "is_array", False):
            value = list(value)
        found.append(f"{item.identifier} {value}")
    return found


@bpy.app.handlers.persistent
def _updated(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Blender has evaluated changes. Of a scene itself it tells too of clicks; ``_unreported`` has the rest of it."""
    if not _last.is_opening and depsgraph.mode == "VIEWPORT" and any(
            update.is_updated_geometry or update.is_updated_transform or update.is_updated_shading
            or not isinstance(update.id, bpy.types.Scene) for update in depsgraph.updates):
        _edited()


@bpy.app.handlers.persistent
def _edited(*_: object) -> None:
    global _last
    _last = _State()


@bpy.app.handlers.persistent
def _opened(*_: object) -> None:
    global _last
    _last = _State(unreported=digest(_unreported()), is_opening=not bpy.app.background)
    path = Path(bpy.data.filepath)
    if bpy.data.filepath and path.is_file():
        _last.names, _last.time = {file_stamp(path)}, path.stat().st_mtime_ns
    if _last.is_opening:  # until all that was opened is evaluated
        bpy.app.timers.register(functools.partial(setattr, _last, "is_opening", False), first_interval=0)


@bpy.app.handlers.persistent
def _saved(path: str, *_: object) -> None:
    """The scene as it is now is in the file ``path``: opened again, it is the same."""
    state = _state()
    if path and Path(path).suffix == ".blend":
        state.names.add(file_stamp(Path(path)))
        for record in filter(Path.is_file, state.records):
            write_json(record, sorted(state.names))


HANDLERS = (("depsgraph_update_post", _updated), ("undo_post", _edited), ("redo_post", _edited),
            ("load_post", _opened), ("save_post", _saved))


def register() -> None:
    """Count edits from now on."""
    _edited()
