"""Which Python runs the second stage, and which Blender runs a render in the background.

The second stage runs in a process of its own: with Blender's Python and the
wheels of the extension, or with a Python of the user's choice.
"""

from __future__ import annotations

import fnmatch
import hashlib
import importlib.util
import os
import sys
from pathlib import Path

import bpy

from lfsr_core.cores import CORES
from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.methods.oidn import LIBRARY_VARIABLE

PACKAGE = __package__.rpartition(".")[0]  # the add-on, under the name that Blender gave it
PYTHON_VARIABLE = "LFSR_PYTHON"
HERE = Path(__file__).resolve().parent
LAUNCHER, ENTRY = HERE / "launch.py", HERE.parent / "headless" / "entry.py"
# Variables that would make a Python look for modules elsewhere than it does on its own.
PYTHON_VARIABLES = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "PYTHONSAFEPATH")


def second_stage_command(module: str = "lfsr_core.cli") -> list[str]:
    """Command line that runs ``module`` of lfsr_core in the second stage's Python; append the module's arguments.

    Start it with ``environment()``. LfsrError where the Python that was chosen does not exist.
    """
    chosen = chosen_python()
    start = [chosen] if chosen else [sys.executable, "-I"]
    return [*start, str(LAUNCHER), _paths(), module]


def render_command(job_file: str | Path) -> list[str]:
    """Command line that runs one render job (lfsr_core.frames.job) in another Blender of this version."""
    if not bpy.app.binary_path:  # the bpy wheel
        return [sys.executable, str(ENTRY), "--", _paths(), str(job_file)]
    return [bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1",
            "--python", str(ENTRY), "--", _paths(), str(job_file)]


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
    """Environment for those processes: this one's, without the variables that change where Python finds modules."""
    kept = {name: value for name, value in os.environ.items() if name not in PYTHON_VARIABLES}
    library = chosen_library()
    chosen = {LIBRARY_VARIABLE: library} if library else {}
    return _few_cores() | kept | chosen | {"PYTHONUNBUFFERED": "1", "PYTHONUTF8": "1"}


def _few_cores() -> dict[str, str]:
    """Variables that leave the preferred number of cores to this Blender and other programs."""
    cores = str(max(1, (os.cpu_count() or 1) - getattr(_preferences(), "free_cores", 1)))
    return {CORES: cores, "OIDN_NUM_THREADS": cores}


def temporary(kind: str, folder: Path) -> Path:
    """Path for what is made of a frame folder, among this session's temporary files."""
    name = hashlib.md5(str(folder).encode(), usedforsecurity=False).hexdigest()[:16]
    return Path(bpy.app.tempdir, f"lfsr-{kind}-{name}")


def chosen_python() -> str | None:
    """The user's own Python: the preference, else $LFSR_PYTHON; None means Blender's."""
    preferred = getattr(_preferences(), "python_path", "").strip()
    chosen: str = bpy.path.abspath(preferred) if preferred else os.environ.get(PYTHON_VARIABLE, "")
    if chosen and not Path(chosen).is_file():
        raise LfsrError(f"Python {chosen!r} does not exist: choose another in the add-on's preferences, or clear it "
                        "to use Blender's own")
    return chosen or None


def chosen_library() -> str:
    """The user's own library of Open Image Denoise: the preference, else $LFSR_OIDN; "" means one that is found."""
    preferred = getattr(_preferences(), "oidn_path", "").strip()
    chosen: str = bpy.path.abspath(preferred) if preferred else os.environ.get(LIBRARY_VARIABLE, "")
    if chosen and not Path(chosen).is_file():
        raise LfsrError(f"the library {chosen!r} of Open Image Denoise does not exist: choose another in the add-on's "
                        "preferences, or clear it")
    return chosen


def _preferences() -> bpy.types.AddonPreferences | None:
    """The add-on's preferences; None where it was not enabled in them."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


def site_packages() -> list[Path]:
    """Folders that the second stage needs beside its Python's own: lfsr_core's first, then Blender's."""
    core = importlib.util.find_spec("lfsr_core")
    if core is None or core.origin is None:
        raise LfsrError("the package lfsr_core is not installed: install the add-on from its zip again")
    # Blender's own OpenImageIO and OpenColorIO lie where its Python may not look outside Blender.
    own = [Path(bpy.utils.resource_path("LOCAL"), "python", "lib", name, "site-packages")
           for name in (f"python{sys.version_info[0]}.{sys.version_info[1]}", "")]
    return [Path(core.origin).parents[1], *(folder for folder in own if folder.is_dir())]


def _paths() -> str:
    return os.pathsep.join(map(str, site_packages()))
