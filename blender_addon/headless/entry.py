"""Run render jobs in another Blender, or encode a film there.

    python entry.py -- FOLDERS JOB.json...                           (bpy wheel)
    blender --background --python entry.py -- FOLDERS JOB.json...
    blender --background --python entry.py -- FOLDERS encode FRAMES FILE.mp4

FOLDERS, joined as in PATH, are where lfsr_core lies. This package is loaded under
its own name, because a Blender with factory settings has no extension enabled.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import shutil
import sys
from pathlib import Path

import bpy


def load_addon() -> None:
    """Import the package of this file as ``blender_addon``, whatever its folder is called."""
    here = Path(__file__).resolve().parent
    # Modules in this folder must not hide others of the same name.
    sys.path[:] = [path for path in sys.path if path and Path(path).resolve() != here]
    package = here.parent
    spec = importlib.util.spec_from_file_location("blender_addon", package / "__init__.py",
                                                  submodule_search_locations=[str(package)])
    assert spec is not None and spec.loader is not None
    module = sys.modules["blender_addon"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)


if __name__ == "__main__":
    paths, *arguments = sys.argv[sys.argv.index("--") + 1:]
    sys.path += paths.split(os.pathsep)
    load_addon()
    code = importlib.import_module("blender_addon.headless.main").main(arguments)
    sys.stdout.flush()
    # Blender replaces a script's exit code with its own, so the process ends here and tidies up by itself.
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)
