"""The depths of a scene as a script in Blender writes them, which are those that a choice of a scale sees."""

import json

import bpy
import pytest

from blender_addon.scene.array.placement import moves_of
from blender_addon.scene.subject import find_subject
from lfsr_core.process.blender import find_blender
from lfsr_lab.scenes import run_script, scene_script
from tests.support.scenes import MINI, add_box, add_camera


def test_it_sees_what_auto_sees(scene, tmp_path):
    add_box(scene, (0, 3, 0), (0.4, 0.1, 0.4))
    add_box(scene, (0.5, 9, 0), (1.0, 0.1, 1.0))
    add_camera(scene, (0, 0, 0), 0.7)
    expected = moves_of(scene, MINI, find_subject(scene))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    job, output = tmp_path / "job.json", tmp_path / "moves.json"
    job.write_text(json.dumps({"scene": str(tmp_path / "scene.blend"), "display": MINI.to_dict(),
                               "output": str(output)}))
    run_script(find_blender(), scene_script("seen_depths.py"), job, [output])
    assert json.loads(output.read_text()) == pytest.approx(sorted(expected), abs=1e-5)
    assert len(expected) > 50 and expected.max() > 0.1
