"""Scripts that write the laboratory's scenes or change one: what stands in them, and where."""

import json

import bpy
import numpy as np
import pytest
from mathutils import Vector
from PIL import Image

import lfsr_lab.scenes
from blender_addon.scene.array import placement
from blender_addon.scene.contents import find_subject
from blender_addon.scene.files import open_scene
from lfsr_core.base.system import write_json
from lfsr_core.process.child import find_blender
from lfsr_lab.experiments.animations.study import NAMES
from lfsr_lab.scenes import scene_script
from tests.support.processes import run_script
from tests.support.scenes import MINI, ROOT, TINY, add_box, add_camera, emission

SCRIPTS = ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes"
MOVING = {"object": "ball", "turn": "ball", "light": "lamp", "dance": "dancer"}  # the camera in the others
UNSEEN = ("glitter", "cloth", "room", "city", "deep", "world")
MODELS = ("FlightHelmet.gltf", "GlassVaseFlowers.gltf", "head.glb", "japaneseMaple.obj")


@pytest.fixture(autouse=True)
def scripts(monkeypatch):
    """Scripts are modules here."""
    monkeypatch.syspath_prepend(str(SCRIPTS))


def corners(items):
    """Bounding boxes of meshes in world space, (n, 8, 3)."""
    return np.array([[item.matrix_world @ Vector(corner) for corner in item.bound_box]
                     for item in items if item.type == "MESH"])


@pytest.mark.parametrize("name", NAMES)
def test_one_thing_moves_in_an_animation_and_nothing_else(name):
    import animation_scenes

    from lfsr_lab.scenes.sweeps.stage import Stage

    assert set(animation_scenes.BUILDERS) == set(NAMES)
    animation_scenes.BUILDERS[name](Stage.empty(TINY, 4, 4), 0.0)
    scene, places = bpy.context.scene, []
    for frame in (1, 4):
        scene.frame_set(frame)
        places.append({item.name: item.matrix_world.copy() for item in scene.objects if item.parent is None})
    moved = {item for item, place in places[0].items() if place != places[1][item]}
    assert moved == {MOVING.get(name, scene.camera.name)}
    assert (scene.frame_start, scene.frame_end) == (1, 4) and len(scene.objects) > 5


def unseen(name):
    """One of the scenes that are kept out of all tuning, built in this Blender."""
    import unseen_scenes

    assert tuple(unseen_scenes.BUILDERS) == UNSEEN
    unseen_scenes.demo_camera()
    unseen_scenes.BUILDERS[name](np.random.default_rng(5))
    bpy.context.view_layer.update()
    return bpy.context.scene, corners(bpy.context.scene.objects)


@pytest.mark.parametrize("name", UNSEEN)
def test_an_unseen_scene_stands_before_its_camera_around_the_display_plane_and_is_lit(name):
    scene, places = unseen(name)
    middle = places.mean(1)
    assert np.isfinite(places).all() and (places[..., 1] > scene.camera.location.y).all()
    assert (np.abs(middle[:, [0, 2]]) < (4.5, 2.6)).all(), "a thing beside the display"
    assert scene.world.node_tree.nodes and scene.render.film_transparent == (name != "world")
    assert np.ptp(middle[:, 1]) > (4 if name in ("deep", "city") else 0.5)
    if name == "city":
        np.testing.assert_array_equal(unseen(name)[1], places, "the same numbers give the same scene")


def test_textured_scenes_stand_before_their_cameras_with_light_and_photographs(tmp_path):
    import textured_scenes

    for number in range(2):
        Image.fromarray(np.full((4, 6, 3), 90 * number, np.uint8)).save(tmp_path / f"{number}.png")
    assert run_script("textured_scenes.py", tmp_path, tmp_path / "out")[0] == 0
    assert {path.stem for path in (tmp_path / "out").glob("*.blend")} == set(textured_scenes.NAMES)
    assert len(textured_scenes.NAMES) == 10
    for name in textured_scenes.NAMES:
        scene = open_scene(tmp_path / "out" / f"{name}.blend")
        meshes = [item for item in scene.objects if item.type == "MESH"]
        assert len(meshes) > 3 and scene.world.node_tree.nodes, name
        assert all(item.location.y > scene.camera.location.y for item in meshes), name
        if name not in ("hair", "clutter"):
            assert any(image.size[:] == (6, 4) and image.packed_file for image in bpy.data.images), name


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


def test_models_of_deep_scenes_stand_one_behind_another_and_a_missing_one_is_named(models, tmp_path):
    assert run_script("deep_scenes.py", models, tmp_path / "scenes")[0] == 0
    assert {path.name for path in (tmp_path / "scenes").iterdir()} == {"row.blend", "grove.blend", "steps.blend"}
    scene = open_scene(tmp_path / "scenes" / "row.blend")
    bpy.context.view_layer.update()
    things = sorted((item for item in scene.objects if item.parent is None), key=lambda item: item.location.y)
    assert tuple(thing.name for thing in things) == MODELS
    for thing in things:
        box = corners(thing.children_recursive).reshape(-1, 3)
        np.testing.assert_allclose((box.min(0) + box.max(0)) / 2, thing.location, atol=1e-5)
        if not thing.rotation_euler.z:
            assert np.ptp(box, axis=0).max() == pytest.approx(thing.scale.x)
    assert not [item for item in scene.objects if item.type == "LIGHT"]
    assert scene.render.film_transparent and all(image.packed_file for image in bpy.data.images if image.filepath)
    next(models.rglob("*.obj")).unlink()
    code, messages = run_script("deep_scenes.py", models, tmp_path / "others")
    assert code == 2 and "japaneseMaple.obj" in messages[-1]["message"]


def test_a_moved_array_keeps_its_display_plane(scene, tmp_path):
    """As the paper's Fig. 10(b) needs it."""
    def placed(path):
        scene = open_scene(path)
        array, matrix = placement.place_array(scene, MINI, find_subject(scene))
        return array, np.array(matrix)

    add_box(scene, (0.3, -0.2, 0.1), (0.5, 0.4, 0.3), emission((1, 0.5, 0.2)))
    blend, after = tmp_path / "scene.blend", tmp_path / "moved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    before, place = placed(blend)
    for share in (0.5, 2.0):
        write_json(tmp_path / "job.json", {"scene": str(blend), "display": MINI.to_dict(), "share": share,
                                           "output": str(after)})
        assert run_script("move_camera_array.py", tmp_path / "job.json")[0] == 0
        array, moved = placed(after)
        for name in ("distance", "half_width", "half_height", "spacing"):
            assert getattr(array, name) == pytest.approx(share * getattr(before, name), rel=1e-5), name
        assert moved[:3, :3] == pytest.approx(place[:3, :3], abs=1e-6)
        plane, moved_plane = (m[:3, 3] + a.distance * m[:3, 2] for m, a in ((place, before), (moved, array)))
        assert moved_plane == pytest.approx(plane, abs=1e-5)


def test_a_script_sees_the_depths_that_auto_sees(scene, tmp_path):
    add_box(scene, (0, 3, 0), (0.4, 0.1, 0.4))
    add_box(scene, (0.5, 9, 0), (1.0, 0.1, 1.0))
    add_camera(scene, (0, 0, 0), 0.7)
    expected = placement.moves_of(scene, MINI, find_subject(scene))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    job, output = tmp_path / "job.json", tmp_path / "moves.json"
    write_json(job, {"scene": str(tmp_path / "scene.blend"), "display": MINI.to_dict(), "output": str(output)})
    lfsr_lab.scenes.run_script(find_blender(), scene_script("seen_depths.py"), job, [output])
    assert json.loads(output.read_text()) == pytest.approx(sorted(expected), abs=1e-5)
    assert len(expected) > 50 and expected.max() > 0.1
