"""Scenes of the stability suite, one .blend per value of a dial: run inside Blender with a JSON file as last argument.

    python scripts/lab/lfsr_lab/scenes/stress_scenes.py SCENES.json
    blender --background --python scripts/lab/lfsr_lab/scenes/stress_scenes.py -- SCENES.json

The file holds "display" (a profile), "scale", "frames" and "scenes": objects of
"dial", "value" and "path". `lfsr stress` writes it; docs/results/stress.md says what the
dials are. The scenes render with `lfsr render` and `lfsr reference` as they are.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.render.protocol import emit
from lfsr_lab.scenes.shared.script import leave, run, save
from lfsr_lab.scenes.stress import dials
from lfsr_lab.scenes.stress.stage import Stage


def build(data: dict[str, Any]) -> None:
    """Write every scene of a job."""
    profile = DisplayProfile.from_dict(data["display"])
    for number, entry in enumerate(data["scenes"]):
        emit(stage="scene", fraction=number / len(data["scenes"]), message=f"{entry['dial']} {entry['value']:g}")
        stage = Stage.empty(profile, data["scale"], data["frames"])
        dials.BUILDERS[entry["dial"]](stage, entry["value"])
        save(Path(entry["path"]))


if __name__ == "__main__":
    leave(run(build, "a list of stress scenes"))
