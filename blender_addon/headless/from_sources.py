"""Run render requests in another Blender from a clone or an installed package, as ``entry.py`` does in an extension.

    python -P from_sources.py -- REQUEST.json...                                     (bpy wheel)
    blender --background --factory-startup --python from_sources.py -- REQUEST.json...

This file is not in the zip: an extension must not change where Python finds modules.
"""

import sys
from pathlib import Path

# The folder of both packages, after Blender's own, whose NumPy must win.
sys.path.append(str(Path(__file__).resolve().parents[2]))

from blender_addon.headless import entry, main

if __name__ == "__main__":
    entry.run(main.main)
