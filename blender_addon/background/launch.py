"""Run a module of lfsr_core: launch.py FOLDERS MODULE [ARGUMENT...]

FOLDERS, joined as in PATH, hold lfsr_core (the first) and other packages that this
Python may lack. Its own packages take precedence, except lfsr_core, which must be
the one that the add-on was built with.
"""

from __future__ import annotations

import importlib.util
import os
import runpy
import sys
from pathlib import Path


def prepare(folders: list[str]) -> None:
    """Make lfsr_core of the first folder importable, and the packages in all ``folders``."""
    here = str(Path(__file__).resolve().parent)
    # This folder's modules must not hide others of the same name.
    sys.path[:] = [path for path in sys.path if path and str(Path(path).resolve()) != here]
    sys.path += [folder for folder in folders if folder not in sys.path]
    _add_libraries(folders)
    package = Path(folders[0], "lfsr_core")
    spec = importlib.util.spec_from_file_location("lfsr_core", package / "__init__.py",
                                                  submodule_search_locations=[str(package)])
    assert spec and spec.loader
    module = sys.modules["lfsr_core"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)


def _add_libraries(folders: list[str]) -> None:
    """On Windows, Blender's modules find Blender's libraries only where their folder is added."""
    if not hasattr(os, "add_dll_directory"):
        return
    for folder in folders:
        for parent in Path(folder).parents:
            if (parent / "blender.shared").is_dir():
                os.add_dll_directory(str(parent / "blender.shared"))


def main() -> None:
    """Run the module named on the command line as if it were a program."""
    folders, module = sys.argv[1].split(os.pathsep), sys.argv[2]
    prepare(folders)
    sys.argv = [module, *sys.argv[3:]]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
