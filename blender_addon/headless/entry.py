"""Run render requests in another Blender, or encode a film there, with this extension wherever it is installed.

    python -P entry.py -- REQUEST.json...                                            (bpy wheel)
    blender --background --factory-startup --python entry.py -- REQUEST.json...
    blender --background --factory-startup --python entry.py -- encode FRAMES FILE.mp4 RATE

From the repository ``from_sources.py`` does the same.
"""

import importlib
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import bpy

REPOSITORY = "lfsr_background"


def run(main: Callable[[Sequence[str]], int]) -> NoReturn:
    """Run ``main`` with the words after "--" on the command line, and end Blender with its exit code."""
    code = main(sys.argv[sys.argv.index("--") + 1:])
    sys.stdout.flush()
    # Blender replaces a script's exit code with its own, so the process ends here and tidies up by itself.
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)


if __name__ == "__main__":
    # ``headless.main`` of this extension, from a repository that only this Blender knows, and only until it ends:
    # factory settings have no repository of the user's, and no add-on enabled.
    PACKAGE = Path(__file__).resolve().parents[1]
    repos = bpy.context.preferences.extensions.repos
    repository = repos.new(name="LFSR", module=REPOSITORY, custom_directory=str(PACKAGE.parent))
    run(importlib.import_module(f"bl_ext.{repository.module}.{PACKAGE.name}.headless.main").main)
