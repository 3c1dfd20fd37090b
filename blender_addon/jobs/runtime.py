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
from lfsr_core.process.child import BLENDER_FOLDER, PACKAGES
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
    # Where the preferences say that no Python is run.
    excluded = any(fnmatch.fnmatch(file, entry.path) if entry.use_glob else
                   entry.path and Path(file).is_relative_to(bpy.path.abspath(entry.path))
                   for entry in preferences.autoexec_paths)
    return preferences.filepaths.use_scripts_auto_execute and not bpy.app.autoexec_fail and not excluded


def environment() -> dict[str, str]:
    """Environment for those processes: this one's, with Python's variables replaced by ours.

    lfsr_core is the add-on's own, even if the Python has another. A Python that the user chose brings its other
    packages; Blender's own gets Blender's.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    blender, folders = Path(bpy.utils.resource_path("LOCAL")), [PACKAGES]
    if not chosen_python():  # Blender's OpenImageIO and OpenColorIO, where its Python may not look outside Blender
        library = blender / "python" / "lib"
        places = (library / f"python{sys.version_info[0]}.{sys.version_info[1]}", library)
        folders += [place / "site-packages" for place in places if (place / "site-packages").is_dir()]
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


def chosen_python() -> str:
    """The user's own Python: the preference, else $LFSR_PYTHON; "" means Blender's."""
    return _chosen("python_path", PYTHON_VARIABLE, "Python {!r} does not exist: choose another in the add-on's "
                   "preferences, or clear it to use Blender's own")


def chosen_library() -> str:
    """The user's own library of Open Image Denoise: the preference, else $LFSR_OIDN; "" means one that is found."""
    return _chosen("oidn_path", LIBRARY_VARIABLE, "the library {!r} of Open Image Denoise does not exist: choose "
                   "another in the add-on's preferences, or clear it")


def _chosen(preference: str, variable: str, missing: str) -> str:
    """The file of a preference, else of an environment variable, else ""; LfsrError ``missing`` if it is not there."""
    preferred = getattr(preferences_of_addon(), preference, "").strip()
    chosen: str = bpy.path.abspath(preferred) if preferred else os.environ.get(variable, "")
    if chosen and not Path(chosen).is_file():
        raise LfsrError(missing.format(chosen))
    return chosen


def preferences_of_addon() -> bpy.types.AddonPreferences | None:
    """The add-on's preferences; None where it was not enabled in them."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None
