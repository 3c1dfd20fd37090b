"""The scenes by which pooling was judged: each builds before the camera, with light and photographs."""

import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
from PIL import Image

from tests.support.prerequisites import needs_bpy

pytestmark = needs_bpy
SCRIPTS = Path(__file__).parents[3] / "scripts" / "lab" / "lfsr_lab" / "scenes"


def test_every_scene_stands_before_its_camera_and_is_lit(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import textured_scenes

    for number in range(2):
        Image.fromarray(np.full((4, 6, 3), 90 * number, np.uint8)).save(tmp_path / f"{number}.png")
    for name in textured_scenes.NAMES:
        textured_scenes.demo_camera()
        getattr(textured_scenes.Scenes(tmp_path), name)(np.random.default_rng(5))
        bpy.context.view_layer.update()
        scene = bpy.context.scene
        meshes = [item for item in scene.objects if item.type == "MESH"]
        assert len(meshes) > 3 and scene.world.node_tree.nodes, name
        assert all(item.location.y > scene.camera.location.y for item in meshes), name
        if name not in ("hair", "clutter"):
            assert any(image.size[:] == (6, 4) for image in bpy.data.images), name


def test_the_script_writes_them(tmp_path):
    Image.fromarray(np.zeros((4, 6, 3), np.uint8)).save(tmp_path / "0.png")
    command = [sys.executable, str(SCRIPTS / "textured_scenes.py"), str(tmp_path), str(tmp_path / "out")]
    subprocess.run(command, check=True, capture_output=True)
    assert len(list((tmp_path / "out").glob("*.blend"))) == 10
