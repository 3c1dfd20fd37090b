"""What a button starts: one process that works for the panel, followed without waiting, stopped; the file it works on.

Both stages run outside this Blender. A render inside it could neither be stopped from Python (Cycles returns when its
image is done) nor let the artist edit the scene, and a crash would take the artist's work along. The price is a second
copy of the scene in memory and the seconds that it takes to open.

The copy of the open file lies beside the render's stored parts until the image is published. After a render that ended
early it is used again if the scene was not edited since, saved or not, and the parts with it. Edits are counted while
the file is open; the scene of a file that was opened has the stamp of that file.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import functools
import itertools
import os
import secrets
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.messages import LfsrError, Notice, Progress
from lfsr_core.base.records import to_data
from lfsr_core.base.system import file_stamp, read_json, remove_dead, write_json
from lfsr_core.frames.folder import FrameFolder, digest
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.parts import has_parts
from lfsr_core.process.child import Child, told_of

from ..scene import folders
from ..scene.overrides import overridden
from ..scene.subject import collections as layer_collections
from . import images, runtime

SECONDS_TO_STOP = 1.5
LEAST_LEFT = 0.5  # seconds
SAVE = Progress("save")
COPY_FOLDER, RECORD = "copy", "names.json"  # in the folder of the parts, and in that of the copy
# A request names its frame; whether a compositor is used decides nothing.
FREE = ("frame_current", "frame_current_final", "frame_float", "frame_subframe", "use_nodes")
STARTING = ("make", "reference", "plan", "estimate", "export", "show")  # tasks that start Blender


@dataclasses.dataclass(frozen=True)
class Job:
    """A task of ``lfsr_core.tasks.runner``, and what follows it."""

    task: str
    arguments: Mapping[str, Any]  # records and JSON-ready data; a ``Request`` among them gets a copy of the open file
    finish: Callable[[dict[str, Any]], None]  # called with the task's result
    notice: Callable[[Notice], bool] = lambda _: False  # called with each; True if it need not be shown
    output: Path | None = None  # folder of the frame, or of the frames, that it renders
    frames: tuple[int, ...] = ()  # of an animation
    kept: Callable[[], str] = lambda: ""  # what to say of what is kept when it ends early


class Task:
    """A job under way; ``progress`` is what it told last."""

    def __init__(self, title: str, job: Job) -> None:
        """Announce that a copy of the file is saved; the first ``poll`` saves it and starts the process."""
        self.title, self.job, self.progress = title, job, SAVE
        self.notices: list[Notice] = []
        self.result: dict[str, Any] | None = None
        self.ended = False  # done, failed or cancelled
        self.child: Child | None = None
        self._started = self._heard = time.monotonic()
        self._shown = 0.0
        self._folder: Path | None = None
        self._copy: contextlib.AbstractContextManager[Path] | None = None
        self._reader: threading.Thread | None = None
        self._records: collections.deque[tuple[float, dict[str, Any]]] = collections.deque()

    @property
    def seconds(self) -> float:
        """Seconds since it was started."""
        return time.monotonic() - self._started

    @property
    def seconds_left(self) -> float | None:
        """Seconds left of the whole task; None while they cannot be told."""
        left = self.progress.left
        # One that is late by some seconds is expected to take as many more.
        return None if left is None else max(abs(left - (time.monotonic() - self._heard)), LEAST_LEFT)

    @property
    def fraction(self) -> float:
        """Fraction of the whole task that is done, 0 to 1: as its time goes, and at least what was told."""
        done, left, passed = self.progress.fraction, self.seconds_left, time.monotonic() - self._heard
        share = done if left is None else done + (1 - done) * passed / (passed + left)
        self._shown = min(1.0, max(self._shown, share))
        return self._shown

    def poll(self) -> bool:
        """Take what the process has told; True once it is done. LfsrError if it failed."""
        if self.ended:
            return True
        try:
            if self.child is None:
                self._start()
                return False
            running = self._reader is not None and self._reader.is_alive()
            while self._records:
                self._take(*self._records.popleft())
            if running:
                return False
            if not self.child.is_done():
                raise self.child.crash(f"{self.title} stopped with", "try again, or save and report it")
        except BaseException:
            self.cancel()
            raise
        self.result = {name: value for name, value in self.child.last.items() if name != "stage"}
        self._end(None)
        return True

    def run(self) -> dict[str, Any]:
        """Wait for the end and return the result, for scripts and background mode."""
        try:
            while not self.poll():
                if self._reader is not None:
                    self._reader.join(0.1)
        except BaseException:
            self.cancel()
            raise
        return self.result or {}

    def cancel(self) -> None:
        """Stop the process and what it has started; finished parts and frames stay."""
        if self.child is not None:
            self.child.stop(SECONDS_TO_STOP)
            output, frames = self.job.output, self.job.frames
            targets = [FrameFolder.of_frame(output, number).path for number in frames] if output else []
            for target in targets if frames else filter(None, [output]):
                if target.parent.is_dir():
                    remove_dead(target)
        self._end(KeyboardInterrupt())

    def _start(self) -> None:
        self._folder = folder = Path(tempfile.mkdtemp(prefix="lfsr-", dir=bpy.app.tempdir or None))
        data = dict(self.job.arguments)
        if self.job.task in STARTING:
            data["command"] = runtime.render_command()
        if requests := {name: value for name, value in data.items() if isinstance(value, Request)}:
            self._copy = file_copy(self.job.output)
            scene = str(self._copy.__enter__())
            data |= {name: dataclasses.replace(request, scene=scene) for name, request in requests.items()}
        task, temporary = folder / "task.json", folder / "temporary"
        temporary.mkdir()
        write_json(task, {"task": self.job.task, **to_data(data)})
        command = [*runtime.second_stage_command(runtime.RUNNER), str(task)]
        # What a process that is killed leaves goes with the folder.
        environment = runtime.environment() | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(temporary))
        try:
            self.child = Child(command, environment, low_priority=True)
        except OSError as error:
            raise LfsrError(f"{self.title} cannot start {command[0]!r} ({error.strerror}): check the add-on's "
                            "preferences") from None
        self.progress = Progress("open") if requests else Progress(self.job.task)
        records = ((time.monotonic(), record) for record in self.child.records())
        self._reader = threading.Thread(target=self._records.extend, args=(records,), daemon=True)
        self._reader.start()

    def _take(self, heard: float, record: dict[str, Any]) -> None:
        told = told_of(record)
        if isinstance(told, Notice):
            if not self.job.notice(told) and told not in self.notices:
                self.notices.append(told)
        elif told is not None:
            if told.left != self.progress.left:  # else it was said again, and counts down since
                self._heard = heard
            self.progress = told

    def _end(self, error: BaseException | None) -> None:
        """Tidy up; the copy stays after an ``error``, if the render has left parts."""
        self.ended = True
        if self._copy is not None:
            copy, self._copy = self._copy, None
            with contextlib.suppress(KeyboardInterrupt):
                copy.__exit__(type(error) if error else None, error, None)
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)


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
    preferences = bpy.context.preferences
    try:
        # Without the picture for file browsers, which would be rendered; the preferences do not count as changed.
        with (images.wait_cursor(), overridden(preferences, {"is_dirty": preferences.is_dirty}),
              overridden(preferences.filepaths, {"file_preview_type": "NONE"})):
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
               for each in (layer.layer_collection, *layer_collections(layer.layer_collection))]
    used = bpy.data.user_map(key_types={"IMAGE"}, value_types={"MATERIAL", "WORLD", "LIGHT", "NODETREE", "TEXTURE"})
    images = [[image.name_full, image.source, image.filepath, image.alpha_mode, image.colorspace_settings.name]
              for image, users in used.items() if users]
    markers = [[marker.frame, marker.camera and marker.camera.name_full]
               for scene in bpy.data.scenes for marker in scene.timeline_markers]
    found = []
    for owner in owners:
        for item in owner.bl_rna.properties if owner is not None else ():
            if item.identifier in FREE or item.type == "COLLECTION":
                continue
            value = getattr(owner, item.identifier)
            if item.type == "POINTER":  # the name of a data-block
                value = getattr(value, "name_full", "")
            elif isinstance(value, set):
                value = sorted(value)
            elif getattr(item, "is_array", False):
                value = list(value)
            found.append(f"{item.identifier} {value}")
    return [found, sorted(images), markers]


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
