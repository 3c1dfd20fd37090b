"""Run one render job inside Blender.

    python scripts/blender_entry.py JOB.json                        (bpy wheel)
    blender --background --python scripts/blender_entry.py -- JOB.json

Without a scene in the job, Blender's open file is rendered.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy

from blender_addon import headless

if __name__ == "__main__":
    code = headless.main(headless.script_arguments())
    sys.stdout.flush()
    # Blender turns a script's SystemExit into its own exit code, so the process ends here, tidied by hand.
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)
