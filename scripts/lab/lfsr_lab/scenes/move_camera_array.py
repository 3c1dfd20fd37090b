"""Save a copy of a scene whose camera array stands nearer or farther; the display plane stays on the subject.

    python scripts/lab/lfsr_lab/scenes/move_camera_array.py JOB.json                        (bpy wheel)
    blender --background --python scripts/lab/lfsr_lab/scenes/move_camera_array.py -- JOB.json

JOB.json: scene, display (a profile), share (fraction of the array's own distance) and output (.blend).
The field of view stays, so the subject fills more of the display where the array is nearer.
"""

import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
import mathutils

from blender_addon.scene.array import edit, placement
from blender_addon.scene.contents import find_subject
from blender_addon.scene.files import open_scene
from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.scenes.shared.objects import script_arguments


def main(job: dict[str, Any]) -> None:
    scene, fraction = open_scene(job["scene"]), job["share"]
    profile = DisplayProfile.from_dict(job["display"])
    array, matrix = placement.place_array(scene, profile, find_subject(scene))
    forward = mathutils.Matrix.Translation((0, 0, (1 - fraction) * array.distance))
    sizes = {name: fraction * getattr(array, name) for name in ("distance", "half_width", "half_height", "spacing")}
    moved = dataclasses.replace(array, **sizes)
    scene.camera = edit.put(scene, profile, (moved, mathutils.Matrix(matrix) @ forward))
    bpy.ops.wm.save_as_mainfile(filepath=job["output"], compress=True)


if __name__ == "__main__":
    main(json.loads(Path(script_arguments()[0]).read_text(encoding="utf-8")))
    sys.stdout.flush()
