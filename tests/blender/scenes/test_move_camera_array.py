"""A scene's camera array, moved nearer and farther by the script behind the paper's Fig. 10(b)."""

import subprocess
import sys

import bpy
import numpy as np
import pytest

from blender_addon.scene.array import placement as rig
from blender_addon.scene.open import open_scene
from blender_addon.scene.subject import find_subject
from lfsr_core.base.files import write_json
from tests.support.scenes import MINI, ROOT, add_box, emission

SCRIPT = ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes" / "move_camera_array.py"


@pytest.fixture
def blend(scene, tmp_path):
    add_box(scene, (0.3, -0.2, 0.1), (0.5, 0.4, 0.3), emission((1, 0.5, 0.2)))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


def placement(path):
    scene = open_scene(path)
    array, matrix = rig.place_array(scene, MINI, find_subject(scene))
    return array, np.array(matrix)


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_the_array_moves_and_the_display_plane_stays(blend, tmp_path, share):
    job = tmp_path / "job.json"
    write_json(job, {"scene": str(blend), "display": MINI.to_dict(), "share": share,
                     "output": str(tmp_path / "moved.blend")})
    subprocess.run([sys.executable, str(SCRIPT), str(job)], check=True, capture_output=True)
    before, place = placement(blend)
    after, moved = placement(tmp_path / "moved.blend")
    for name in ("distance", "half_width", "half_height", "spacing"):
        assert getattr(after, name) == pytest.approx(share * getattr(before, name), rel=1e-5), name
    assert moved[:3, :3] == pytest.approx(place[:3, :3], abs=1e-6)
    plane, moved_plane = (m[:3, 3] + a.distance * m[:3, 2] for m, a in ((place, before), (moved, after)))
    assert moved_plane == pytest.approx(plane, abs=1e-5)
