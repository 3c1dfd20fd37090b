"""Scenes of the stability suite, one .blend per value of a dial: run inside Blender with a JSON file as last argument.

    python scripts/scenes/stress_scenes.py SCENES.json
    blender --background --python scripts/scenes/stress_scenes.py -- SCENES.json

The file holds "display" (a profile), "scale", "frames" and "scenes": objects of
"dial", "value" and "path". `lfsr stress` writes it; docs/results/stress.md says what the
dials are. The scenes render with `lfsr render` and `lfsr reference` as they are.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Any

# This folder, and where lfsr_core lies: beside the installed package, or at the root of a clone.
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.extend(str(folder) for folder in Path(__file__).resolve().parents[1:3])

import bpy
from stress import dials
from stress.stage import Stage

from blender_addon.headless.main import script_arguments
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, read_json
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.render.protocol import EXIT_BAD_INPUT, emit


def build(data: dict[str, Any]) -> None:
    """Write every scene of a job."""
    profile = DisplayProfile.from_dict(data["display"])
    for number, entry in enumerate(data["scenes"]):
        emit(stage="scene", fraction=number / len(data["scenes"]), message=f"{entry['dial']} {entry['value']:g}")
        stage = Stage.empty(profile, data["scale"], data["frames"])
        dials.BUILDERS[entry["dial"]](stage, entry["value"])
        save(Path(entry["path"]))


def save(path: Path) -> None:
    """Write the open scene, whole or not at all."""
    with atomic_path(path) as temporary:
        bpy.ops.wm.save_as_mainfile(filepath=str(temporary), compress=True, copy=True)
        # Blender keeps what it overwrites, here the empty temporary file.
        Path(f"{temporary}1").unlink(missing_ok=True)


def main() -> int:
    """Exit code: 0, 2 on bad input."""
    try:
        build(read_json(script_arguments()[-1], "a list of stress scenes"))
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    emit(stage="done")
    return 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    # Blender turns a script's SystemExit into its own exit code, so the process ends here, tidied by hand.
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)
