"""Models one behind another: each where it should stand, as large as it should be, whatever its file says."""

import subprocess
import sys

import bpy
import numpy as np
import pytest
from mathutils import Vector

from blender_addon.scene.open import open_scene
from tests.support.prerequisites import needs_bpy
from tests.support.scenes import ROOT

pytestmark = needs_bpy
SCRIPT = ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes" / "deep_scenes.py"
MODELS = ("FlightHelmet.gltf", "GlassVaseFlowers.gltf", "head.glb", "japaneseMaple.obj")


def written(folder, *arguments):
    return subprocess.run([sys.executable, str(SCRIPT), *map(str, arguments), str(folder)], capture_output=True,
                          text=True, check=False)


@pytest.fixture
def models(tmp_path):
    """Folder of four blocks of other sizes and places, named as the models are, the first with a lamp."""
    for number, name in enumerate(MODELS):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.ops.mesh.primitive_cube_add(location=(5 * number, 1, -3))
        bpy.context.object.scale = (2 + number, 1, 0.5)
        if not number:
            bpy.ops.object.light_add(type="POINT")
        path = tmp_path / "models" / f"in {number}" / name
        path.parent.mkdir(parents=True)
        if name.endswith("obj"):
            bpy.ops.wm.obj_export(filepath=str(path))
        else:
            kind = "GLB" if name.endswith("glb") else "GLTF_SEPARATE"
            bpy.ops.export_scene.gltf(filepath=str(path), export_format=kind, export_lights=True)
    return tmp_path / "models"


def box_of(thing):
    corners = [part.matrix_world @ Vector(corner) for part in thing.children_recursive if part.type == "MESH"
               for corner in part.bound_box]
    return np.min(corners, 0), np.max(corners, 0)


def test_models_stand_one_behind_another(models, tmp_path):
    made = written(tmp_path / "scenes", models)
    assert made.returncode == 0, made.stderr
    assert {path.name for path in (tmp_path / "scenes").iterdir()} == {"row.blend", "grove.blend", "steps.blend"}
    scene = open_scene(tmp_path / "scenes" / "row.blend")
    bpy.context.view_layer.update()
    things = [item for item in scene.objects if item.parent is None]
    assert [thing.name for thing in sorted(things, key=lambda thing: thing.location.y)] == [
        "FlightHelmet.gltf", "GlassVaseFlowers.gltf", "head.glb", "japaneseMaple.obj"]
    for thing in things:
        low, high = box_of(thing)
        np.testing.assert_allclose((low + high) / 2, thing.location, atol=1e-5)
        if not thing.rotation_euler.z:
            assert max(high - low) == pytest.approx(thing.scale.x)
    assert not [item for item in scene.objects if item.type == "LIGHT"]
    assert scene.render.film_transparent and all(image.packed_file for image in bpy.data.images if image.filepath)


def test_a_missing_model_is_named(models, tmp_path):
    next(models.rglob("*.obj")).unlink()
    failed = written(tmp_path / "scenes", models)
    assert failed.returncode == 2 and "japaneseMaple.obj" in failed.stdout
