"""What every script that writes scenes does: read its job, save what it has built, end Blender's process."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, read_json
from lfsr_core.process.protocol import EXIT_BAD_INPUT, emit


def script_arguments() -> list[str]:
    """Return the script's own arguments: those after ``--`` under Blender, else all."""
    return sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]


def save(path: Path) -> None:
    """Write the open scene, whole or not at all."""
    with atomic_path(path.resolve()) as temporary:
        bpy.ops.wm.save_as_mainfile(filepath=str(temporary), compress=True, copy=True)
        # Blender keeps what it overwrites, here the empty temporary file.
        Path(f"{temporary}1").unlink(missing_ok=True)


def run(build: Callable[[dict[str, Any]], None], what: str) -> int:
    """Build the scenes of the JSON file that is named last, which is ``what``; exit code: 0, 2 on bad input."""
    try:
        build(read_json(script_arguments()[-1], what))
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    emit(stage="done")
    return 0


def leave(code: int) -> NoReturn:
    """End the process here, tidied by hand: Blender turns a script's SystemExit into its own exit code."""
    sys.stdout.flush()
    sys.stderr.flush()
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)
