"""How far neighbouring views of a display move what the middle of the array sees of a scene.

    python scripts/lab/lfsr_lab/scenes/seen_depths.py JOB.json                        (bpy wheel)
    blender --background --python scripts/lab/lfsr_lab/scenes/seen_depths.py -- JOB.json

JOB.json: scene (a file), display (a profile) and output (.json, a list of disparities in lenses, sorted).
`--scale auto` measures the same.
"""

import sys
from pathlib import Path
from typing import Any

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

from blender_addon.scene.array.placement import moves_of
from blender_addon.scene.contents import find_subject
from blender_addon.scene.files import open_scene
from lfsr_core.base.system import write_json
from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.scenes.shared.objects import leave, run


def main(job: dict[str, Any]) -> None:
    """Open the scene and write its disparities."""
    scene = open_scene(job["scene"])
    moves = moves_of(scene, DisplayProfile.from_dict(job["display"]), find_subject(scene))
    write_json(Path(job["output"]), sorted(round(float(move), 6) for move in moves))


if __name__ == "__main__":
    leave(run(main, "the job of seen_depths.py"))
