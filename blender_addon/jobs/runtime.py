"""Which Python runs the second stage, and which Blender runs a render in the background.

The second stage runs in a process of its own: with Blender's Python, or with a
Python of the user's choice. Where it finds modules is said in its environment.
"""

from __future__ import annotations

import fnmatch
import hashlib
import os
import sys
from pathlib import Path

import bpy

from lfsr_core.base.cores import CORES
from lfsr_core.base.errors import LfsrError
from lfsr_core.process.blender import PACKAGES
from lfsr_core.process.protocol import BLENDER_FOLDER
from lfsr_core.reconstruct.methods.oidn import LIBRARY_VARIABLE

PACKAGE = __package__.rpartition(".")[0]  # the add-on, under the name that Blender gave it
RUNNER = "lfsr_core.tasks.runner"
PYTHON_VARIABLE = "LFSR_PYTHON"
HEADLESS = Path(__file__).resolve().parents[1] / "headless"
# A clone has the first, the zip only the second.
ENTRY = next(path for name in ("from_sources.py", "entry.py") if (path := HEADLESS / name).is_file())
# Workers that each started BLAS threads of their own would wait for one another.
ONE_BLAS_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1")


def second_stage_command(module: str) -> list[str]:
    """Command line that runs ``module`` of lfsr_core in the second stage's Python; append the module's arguments.

    Start it with ``environment()``. LfsrError where the Python that was chosen does not exist.
    """
    chosen = chosen_python()
    start = [chosen] if chosen else [sys.executable, "-s"]
    return [*start, "-m", module]


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
    excluded = any(_covers(entry, file) for entry in preferences.autoexec_paths)
    return preferences.filepaths.use_scripts_auto_execute and not bpy.app.autoexec_fail and not excluded


def _covers(entry: bpy.types.PathCompare, file: str) -> bool:
    """True if ``file`` lies where the preferences say that no Python is run."""
    if entry.use_glob:
        return fnmatch.fnmatch(file, entry.path)
    return bool(entry.path) and Path(file).is_relative_to(bpy.path.abspath(entry.path))


def environment() -> dict[str, str]:
    """Environment for those processes: this one's, with Python's variables replaced by ours.

    lfsr_core is the add-on's own, even if the Python has another. A Python that the user chose brings its other
    packages; Blender's own gets Blender's.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    folders = [PACKAGES] if chosen_python() else [PACKAGES, *_blender_packages()]
    library = chosen_library()
    chosen = {LIBRARY_VARIABLE: library} if library else {}
    return _few_cores() | kept | chosen | ONE_BLAS_THREAD | {
        "PYTHONPATH": os.pathsep.join(map(str, folders)), "PYTHONSAFEPATH": "1", "PYTHONUNBUFFERED": "1",
        "PYTHONUTF8": "1", BLENDER_FOLDER: str(Path(bpy.utils.resource_path("LOCAL")).parent)}


def _few_cores() -> dict[str, str]:
    """Variables that leave the preferred number of cores to this Blender and other programs."""
    cores = str(max(1, (os.cpu_count() or 1) - getattr(preferences_of_addon(), "free_cores", 1)))
    return {CORES: cores, "OIDN_NUM_THREADS": cores}


def temporary(kind: str, folder: Path) -> Path:
    """Path for what is made of a frame folder, among this session's temporary files."""
    name = hashlib.md5(str(folder).encode(), usedforsecurity=False).hexdigest()[:16]
    return Path(bpy.app.tempdir, f"lfsr-{kind}-{name}")


def chosen_python() -> str | None:
    """The user's own Python: the preference, else $LFSR_PYTHON; None means Blender's."""
    preferred = getattr(preferences_of_addon(), "python_path", "").strip()
    chosen: str = bpy.path.abspath(preferred) if preferred else os.environ.get(PYTHON_VARIABLE, "")
    if chosen and not Path(chosen).is_file():
        raise LfsrError(f"Python {chosen!r} does not exist: choose another in the add-on's preferences, or clear it "
                        "to use Blender's own")
    return chosen or None


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


def _blender_packages() -> list[Path]:
    """Folders of Blender's own OpenImageIO and OpenColorIO, where its Python may not look outside Blender."""
    library = Path(bpy.utils.resource_path("LOCAL"), "python", "lib")
    folders = (library / f"python{sys.version_info[0]}.{sys.version_info[1]}", library)
    return [folder / "site-packages" for folder in folders if (folder / "site-packages").is_dir()]
