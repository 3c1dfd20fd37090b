"""What the processes that work for the panel get: their commands, their environment, and a copy of the open file.

They are another Blender that renders, and Blender's Python for the second stage. Also: whether that finds Open Image
Denoise, and what can be done without it.

The copy of the open file lies beside the render's stored parts until the image is published. After a render that ended
early, copy and parts are used again if the scene was not edited since, saved or not. Edits are counted while the file
is open; the scene of a file that was opened has the stamp of that file.
"""

import contextlib
import dataclasses
import fnmatch
import functools
import hashlib
import itertools
import os
import platform
import secrets
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import CORES, LOCK_FILE, file_stamp, locks, read_json, remove_locked, write_json
from lfsr_core.frames.folder import FrameFolder, digest
from lfsr_core.pipeline.parts import has_parts
from lfsr_core.process.child import BLENDER_FOLDER, PACKAGES, output_of
from lfsr_core.reconstruct.methods.denoise import LIBRARY_VARIABLE

from ..compat import overridden, wait_cursor
from ..scene.contents import collections as layer_collections
from ..scene.files import disk_cache
from ..scene.settings import Resolved, file_stem, title

PACKAGE = __package__.rpartition(".")[0]  # the add-on, under the name that Blender gave it
RUNNER = "lfsr_core.tasks.runner"
SAY_WHY = "from lfsr_core.reconstruct.methods.denoise import why_missing; print(why_missing())"  # a program
HEADLESS = Path(__file__).resolve().parents[1] / "headless"
# A clone has the first, the zip only the second.
ENTRY = next(path for name in ("from_sources.py", "entry.py") if (path := HEADLESS / name).is_file())
SECONDS_TO_ANSWER = 60
RAYS_UNDENOISED = 2.0  # times as many where nothing is denoised
LIBRARIES = {"win32": "OpenImageDenoise.dll", "darwin": "libOpenImageDenoise.dylib"}
# Packages of the library, by the ID in /etc/os-release. Debian and those made of it have none.
OF_SYSTEMS = {"fedora": "oidn-libs", "arch": "openimagedenoise", "alpine": "openimagedenoise",
              "void": "openimagedenoise", "gentoo": "media-libs/oidn"}
COPY_FOLDER, RECORD = "copy", "names.json"  # in the folder of the parts, and in that of the copy
# Properties that decide no pixel: a request states its frame, and no compositor is applied.
FREE = ("frame_current", "frame_current_final", "frame_float", "frame_subframe", "use_nodes")
# Workers that each started BLAS threads of their own would wait for one another.
ONE_BLAS_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1")


def second_stage_command(*words: str) -> list[str]:
    """Command line of Blender's Python for the second stage, which starts with ``environment()``."""
    return [sys.executable, "-s", *words]


def render_command() -> list[str]:
    """Start of a command line that renders in another Blender of this version; request files follow it."""
    if not bpy.app.binary_path:  # the bpy wheel
        return [sys.executable, "-P", str(ENTRY), "--"]
    scripts = ["--enable-autoexec"] if may_run_scripts(bpy.data.filepath) else []
    return [bpy.app.binary_path, *scripts, "--background", "--factory-startup", "--python-exit-code", "1",
            "--python", str(ENTRY), "--"]


def may_run_scripts(file: str) -> bool:
    """True if this session runs the Python in ``file`` when it opens it: only then may a background Blender.

    A file that has run no Python so far is not trusted: scripts may have been added to it since.
    """
    preferences = bpy.context.preferences
    # Where the preferences say that no Python is run.
    excluded = any(fnmatch.fnmatch(file, entry.path) if entry.use_glob else
                   entry.path and Path(file).is_relative_to(bpy.path.abspath(entry.path))
                   for entry in preferences.autoexec_paths)
    return preferences.filepaths.use_scripts_auto_execute and not bpy.app.autoexec_fail and not excluded


def environment() -> dict[str, str]:
    """Environment for those processes: this one's, with Python's variables replaced by ours.

    lfsr_core is the add-on's own. LfsrError where the library that was chosen does not exist.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    # Blender's OpenImageIO and OpenColorIO, where its Python may not look outside Blender.
    blender = Path(bpy.utils.resource_path("LOCAL"))
    library = blender / "python" / "lib"
    places = (library / f"python{sys.version_info[0]}.{sys.version_info[1]}", library)
    folders = [PACKAGES, *(place / "site-packages" for place in places if (place / "site-packages").is_dir())]
    denoiser = chosen_library()
    # The preferred number of cores is left to this Blender and other programs.
    cores = str(max(1, (os.cpu_count() or 1) - getattr(preferences_of_addon(), "free_cores", 1)))
    return {CORES: cores, "OIDN_NUM_THREADS": cores} | kept | (
        {LIBRARY_VARIABLE: denoiser} if denoiser else {}) | ONE_BLAS_THREAD | {
        "PYTHONPATH": os.pathsep.join(map(str, folders)), "PYTHONSAFEPATH": "1", "PYTHONUNBUFFERED": "1",
        "PYTHONUTF8": "1", BLENDER_FOLDER: str(blender.parent)}


def temporary(kind: str, folder: Path) -> Path:
    """Path for what is made of a frame folder, among this session's temporary files."""
    name = hashlib.md5(str(folder).encode(), usedforsecurity=False).hexdigest()[:16]
    return Path(bpy.app.tempdir, f"lfsr-{kind}-{name}")


def chosen_library() -> str:
    """The user's own library of Open Image Denoise: the preference, else $LFSR_OIDN; "" means one that is found."""
    preferred = getattr(preferences_of_addon(), "oidn_path", "").strip()
    chosen: str = bpy.path.abspath(preferred) if preferred else os.environ.get(LIBRARY_VARIABLE, "")
    if chosen and not Path(chosen).is_file():
        raise LfsrError(f"the library {chosen!r} of Open Image Denoise does not exist: choose another in the add-on's "
                        "preferences, or clear it")
    return chosen


def preferences_of_addon() -> bpy.types.AddonPreferences | None:
    """The add-on's preferences; None where it was not enabled in them."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


def why_missing() -> str:
    """Why the second stage finds no library that loads, "" where it does; its process is asked once in a session."""
    return _why_missing(chosen_library())


@functools.lru_cache(maxsize=8)
def _why_missing(_library: str) -> str:
    code, output = output_of(second_stage_command("-c", SAY_WHY), environment(), SECONDS_TO_ANSWER)
    return output.strip() if code == 0 else ""  # what else it lacks is said by the render


def lacking(settings: Resolved) -> str:
    """Return a sentence if the method of ``settings`` needs the library and it is missing, else ""."""
    reason = why_missing() if settings.method.needs_denoiser else ""
    if not reason:
        return ""
    name = "Direct subpixel rendering" if settings.subpixels else f"The method {title(settings.method.text)}"
    if chosen := chosen_library():
        return f"{name} needs Open Image Denoise, but {reason.replace(chosen, Path(chosen).name)}"
    return f"{name} needs Open Image Denoise, which this Blender does not have"


def use_replacement(scene: bpy.types.Scene, settings: Resolved) -> None:
    """Set the method of ``settings`` without denoising in ``scene``, with more rays: nothing removes their noise.

    If the method was left at its default, new scenes from now on get one that needs no denoiser.
    """
    if (preferences := preferences_of_addon()) is not None and not scene.lfsr.is_property_set("method"):
        preferences.without_denoiser = True
    scene.lfsr.method = settings.method.undenoised.text
    if not scene.lfsr.samples:
        scene.lfsr.rays *= RAYS_UNDENOISED


def where_to_get() -> str:
    """Return a sentence on where to get the library on this system."""
    library, names = LIBRARIES.get(sys.platform, "libOpenImageDenoise.so.2"), list[str]()
    with contextlib.suppress(OSError):  # names of this Linux and of those that it is made of
        system = platform.freedesktop_os_release()
        names = [system.get("ID", ""), *system.get("ID_LIKE", "").split()]
    package = next((OF_SYSTEMS[name] for name in names if name in OF_SYSTEMS), "")
    install = (f"Install the package {package}, or use" if package else
               f"{names[0].capitalize()} has no package of it: use" if {"debian", "ubuntu"} & {*names} else "Use")
    return (f"{install} the Blender of blender.org, which has it, or choose {library} of a download from "
            "openimagedenoise.org in the add-on's preferences")


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

    ``output``: folder of a frame or of an animation's frames; the copy stays after a block that ends early, if the
    render has left parts. None: the copy is temporary; so it is if another Blender renders the copy that is there.
    """
    kept, lock = FrameFolder(output).parts / COPY_FOLDER if output else None, None
    try:
        if kept:
            kept.mkdir(parents=True, exist_ok=True)
            lock = (kept.parent / LOCK_FILE).open("wb")
            kept = kept if locks(lock, otherwise=True) else None
    except OSError:  # no place beside the output
        kept = None
    folder = kept or Path(tempfile.mkdtemp(prefix="lfsr-", dir=bpy.app.tempdir or None))
    stays = False
    try:
        path = _kept_copy(folder) if kept else save_copy(folder / f"{file_stem()}.blend")
        copy_simulations(path)
        yield path
    except BaseException:
        stays = bool(kept and output and any(map(has_parts, (kept.parent, *output.glob(".*-parts")))))
        raise
    finally:
        if not stays:
            shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            remove_locked(lock) if kept else lock.close()
        if kept:
            with contextlib.suppress(OSError):
                kept.parent.rmdir()  # if it is empty


def copy_simulations(copy: Path) -> None:
    """Copy the simulations on the disk beside the open file to beside a ``copy`` of it: Blender may write there."""
    if (cache := disk_cache(Path(bpy.data.filepath))).is_dir():
        shutil.rmtree(disk_cache(copy), ignore_errors=True)  # of an older copy
        shutil.copytree(cache, disk_cache(copy))


def save_copy(path: Path) -> Path:
    """Save the file as it is now as ``path``, stay in the open one, and return the path; LfsrError where that fails."""
    preferences = bpy.context.preferences
    try:
        # Without the picture for file browsers, which would be rendered; the preferences do not count as changed.
        with (wait_cursor(), overridden(preferences, {"is_dirty": preferences.is_dirty}),
              overridden(preferences.filepaths, {"file_preview_type": "NONE"}), contextlib.ExitStack() as stack):
            # Blender does not adapt the folders of baked geometry to the copy's place. ``_updated`` must see no edit.
            stack.enter_context(overridden(_state(), {"is_opening": True}))
            stack.callback(bpy.context.view_layer.update)
            for modifier in (each for item in bpy.data.objects for each in item.modifiers if each.type == "NODES"):
                for owner, name in ((modifier, "bake_directory"), *((bake, "directory") for bake in modifier.bakes)):
                    if getattr(owner, name).startswith("//") and not modifier.id_data.library:
                        stack.enter_context(overridden(owner, {name: bpy.path.abspath(getattr(owner, name))}))
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, check_existing=False, compress=False)
    except RuntimeError as error:
        raise LfsrError(f"a copy of this file cannot be saved to {path.parent} ({str(error).strip()}): "
                        "free some space there") from None
    return path


def _kept_copy(folder: Path) -> Path:
    """Return the copy in ``folder``, saved anew unless it is of the scene as it is now."""
    state, path, record = _state(), folder / f"{file_stem()}.blend", folder / RECORD
    is_same = False
    with contextlib.suppress(LfsrError, TypeError):
        is_same = path.is_file() and not state.names.isdisjoint(read_json(record, "the names of a copy"))
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
    layers = [layer for scene in bpy.data.scenes for layer in scene.view_layers]
    owners = [owner for scene in bpy.data.scenes for owner in (scene, scene.render, scene.view_settings)]
    owners += [getattr(scene, name, None) for scene in bpy.data.scenes for name in ("cycles", "cycles_curves")]
    owners += [owner for layer in layers for owner in (
        layer, getattr(layer, "cycles", None), layer.layer_collection, *layer_collections(layer.layer_collection))]
    used = bpy.data.user_map(key_types={"IMAGE"}, value_types={"MATERIAL", "WORLD", "LIGHT", "NODETREE", "TEXTURE"})
    images = [[image.name_full, image.source, image.filepath, image.alpha_mode, image.colorspace_settings.name]
              for image, users in used.items() if users]
    markers = [[marker.frame, marker.camera and marker.camera.name_full]
               for scene in bpy.data.scenes for marker in scene.timeline_markers]
    values = []
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
            values.append(f"{item.identifier} {value}")
    return [values, sorted(images), markers]


@bpy.app.handlers.persistent
def _updated(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Count an edit. Blender reports an update of the scene for a click too; ``_unreported`` has its settings."""
    if not _last.is_opening and depsgraph.mode == "VIEWPORT" and any(
            update.is_updated_geometry or update.is_updated_transform or update.is_updated_shading
            or not isinstance(update.id, bpy.types.Scene) for update in depsgraph.updates):
        _edited()


@bpy.app.handlers.persistent
def _edited(*_: object) -> None:
    global _last
    _last = _State()


@bpy.app.handlers.persistent
def _opened(opened: str, *_: object) -> None:
    global _last
    _last = _State(unreported=digest(_unreported()), is_opening=not bpy.app.background)
    path = Path(bpy.data.filepath)
    # A recovered session has the path of a file that holds an older scene.
    if path.is_file() and os.path.realpath(opened) == os.path.realpath(path):
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
register = _edited  # edits are counted from then on
