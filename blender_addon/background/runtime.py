"""Which Python runs the second stage, and which Blender runs a render in the background.

The second stage runs in a process of its own: with Blender's Python and the
wheels of the extension, or with a Python of the user's choice, which may have
PyTorch and a GPU.
"""

from __future__ import annotations

import fnmatch
import importlib.util
import os
import sys
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.errors import LfsrError

PACKAGE = __package__.rpartition(".")[0]  # the add-on, under the name that Blender gave it
PYTHON_VARIABLE = "LFSR_PYTHON"
HERE = Path(__file__).resolve().parent
LAUNCHER, ENTRY = HERE / "launch.py", HERE.parent / "headless" / "entry.py"
# Variables that would make a Python look for modules elsewhere than it does on its own.
PYTHON_VARIABLES = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "PYTHONSAFEPATH")


def second_stage_command(module: str = "lfsr_core.cli") -> list[str]:
    """Command line that runs ``module`` of lfsr_core in the second stage's Python; append its arguments.

    The default is the ``lfsr`` command. Start it with ``environment()``. LfsrError
    where the Python that was chosen does not exist.
    """
    own = chosen_python()
    start = [own] if own else [sys.executable, "-I"]
    return [*start, str(LAUNCHER), os.pathsep.join(map(str, site_packages())), module]


def render_command(job_file: str | Path) -> list[str]:
    """Command line that runs one render job (lfsr_core.frames.job) in another Blender of this version."""
    paths = os.pathsep.join(map(str, site_packages()))
    if not bpy.app.binary_path:  # the bpy wheel
        return [sys.executable, str(ENTRY), "--", paths, str(job_file)]
    return [bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1",
            "--python", str(ENTRY), "--", paths, str(job_file)]


def may_run_scripts(file: str) -> bool:
    """True if this session runs the Python in ``file`` when it opens it: only then may a background Blender.

    That it ran nothing is no leave: text that was appended meanwhile has not been asked about yet.
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
    """Environment of those processes: this one's, without what would change where Python looks for modules."""
    kept = {name: value for name, value in os.environ.items() if name not in PYTHON_VARIABLES}
    return kept | {"PYTHONUNBUFFERED": "1", "PYTHONUTF8": "1"}


def chosen_python() -> str | None:
    """The user's own Python: the preference, else $LFSR_PYTHON; None means Blender's."""
    named = python_path() or os.environ.get(PYTHON_VARIABLE, "")
    if named and not Path(named).is_file():
        raise LfsrError(f"Python {named!r} does not exist: choose another in the add-on's preferences, or clear it "
                        "to use Blender's own")
    return named or None


def site_packages() -> list[Path]:
    """Folders that the second stage needs beside its Python's own: lfsr_core's first, then Blender's."""
    core = importlib.util.find_spec("lfsr_core")
    if core is None or core.origin is None:
        raise LfsrError("the package lfsr_core is not installed: install the add-on from its zip again")
    return [Path(core.origin).parents[1], *_blender_packages()]


def _blender_packages() -> list[Path]:
    """Blender's own OpenImageIO and OpenColorIO, which its Python may not look for outside Blender."""
    folders = [Path(bpy.utils.resource_path("LOCAL"), "python", "lib", name, "site-packages")
               for name in (f"python{sys.version_info[0]}.{sys.version_info[1]}", "")]
    return [folder for folder in folders if folder.is_dir()]


def python_path() -> str:
    """The preference "Python with PyTorch" as an absolute path; empty if not set or the add-on is not enabled."""
    path = getattr(_preferences(), "python_path", "").strip()
    return bpy.path.abspath(path) if path else ""


def _preferences() -> Any:
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None
