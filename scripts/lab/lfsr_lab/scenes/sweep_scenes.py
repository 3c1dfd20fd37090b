"""Scenes of the parameter sweeps, one .blend per value: run inside Blender with a JSON file as last argument.

    python scripts/lab/lfsr_lab/scenes/sweep_scenes.py SCENES.json
    blender --background --python scripts/lab/lfsr_lab/scenes/sweep_scenes.py -- SCENES.json

`lfsr study stress` writes the file, see ``write_scenes``; docs/results/stress.md says what the sweeps are. The scenes
render with `lfsr render` and `lfsr reference` as they are.
"""

import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

from lfsr_lab.scenes.sweeps.builders import BUILDERS
from lfsr_lab.scenes.sweeps.stage import write_scenes

if __name__ == "__main__":
    write_scenes(BUILDERS)
