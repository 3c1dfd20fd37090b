"""Save a copy of a scene whose camera array stands nearer or farther; the display plane stays on the subject.

    python scripts/lab/lfsr_lab/scenes/move_camera_array.py JOB.json                        (bpy wheel)
    blender --background --python scripts/lab/lfsr_lab/scenes/move_camera_array.py -- JOB.json

JOB.json: scene, display (a profile), share (of the array's own distance) and output (.blend).
The field of view stays, so the subject fills more of the display where the array is nearer.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
import mathutils

from blender_addon.array import placement, rig
from blender_addon.array.spaces import to_blender
from blender_addon.scene.open import open_scene
from blender_addon.scene.subject import find_subject
from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.scenes.shared.script import script_arguments


def main(job: dict) -> None:
    """Open, move, save."""
    scene = open_scene(job["scene"])
    profile = DisplayProfile.from_dict(job["display"])
    array, matrix = placement.place_array(scene, profile, find_subject(scene))
    back = mathutils.Matrix.Translation((0, 0, (job["share"] - 1) * array.distance))
    add_array(scene, to_blender(matrix) @ back, array.half_width / array.distance, job["share"] * array.distance)
    bpy.ops.wm.save_as_mainfile(filepath=job["output"], compress=True)


def add_array(scene: bpy.types.Scene, matrix: mathutils.Matrix, half_width: float, distance: float) -> None:
    """Make a camera array at ``matrix`` the scene's own; its display is 2 · half_width · distance wide."""
    data = bpy.data.cameras.new("Moved array")
    data.sensor_fit, data.lens = "HORIZONTAL", data.sensor_width / 2 / half_width
    camera, plane = bpy.data.objects.new("Moved array", data), bpy.data.objects.new("Moved display plane", None)
    for item in (camera, plane):
        scene.collection.objects.link(item)
    camera.matrix_world, camera[rig.SPACING] = matrix, 1.0
    plane.parent, plane[rig.PLANE] = camera, True
    plane.location = (0.0, 0.0, -distance)
    scene.camera = camera
    bpy.context.view_layer.update()


if __name__ == "__main__":
    main(json.loads(Path(script_arguments()[0]).read_text(encoding="utf-8")))
    sys.stdout.flush()
