"""The camera array as scene data: moved, saved, chosen; what the render makes of it."""

import bpy
import numpy as np
import pytest

from blender_addon.scene.array import rig
from lfsr_core.optics.display import load_display
from tests.support import panel
from tests.support.problems import found
from tests.support.told import refuses

MINI = load_display("mini")


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


def place(scene):
    return rig.placement(scene, MINI)


def test_moving_the_plane_keeps_the_framing(scene):
    before, _ = place(scene)
    scene.lfsr.distance = 2 * before.distance
    after, _ = place(scene)
    assert after.distance == pytest.approx(2 * before.distance, rel=1e-5)
    assert after.half_width / after.distance == pytest.approx(before.half_width / before.distance, rel=1e-5)
    assert after.spacing == pytest.approx(2 * before.spacing, rel=1e-5)


def test_the_plane_moves_along_the_view_of_a_scaled_turned_array(scene):
    array = rig.find(scene)
    array.rotation_euler, array.scale = (0.4, 0.3, 1.2), (2, 2, 2)
    scene.lfsr.distance = 3.0
    assert scene.lfsr.distance == pytest.approx(3.0, rel=1e-5)
    plane = rig.plane_of(array)
    ahead = array.matrix_world.translation - array.matrix_world.normalized().col[2].to_3d() * 3.0
    assert (plane.matrix_world.translation - ahead).length < 1e-4
    assert tuple(plane.lock_location) == (True, True, False)


@pytest.mark.parametrize("whose", ["array", "parent"])
def test_mirror_of_an_array_is_undone(scene, whose):
    array, parent = rig.find(scene), bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    array.parent, before = parent, place(scene)
    item = {"array": array, "parent": parent}[whose]
    item.scale.x *= -1
    bpy.context.view_layer.update()
    after, matrix = place(scene)
    assert after.distance == pytest.approx(before[0].distance)
    assert np.linalg.det(np.array(matrix)[:3, :3]) == pytest.approx(-1), "array space is left-handed, as before"
    assert np.array(matrix)[:3, 2] == pytest.approx(np.array(before[1])[:3, 2], abs=1e-6)
    scene.lfsr.distance = 3.0
    assert scene.lfsr.distance == pytest.approx(3.0, rel=1e-5)
    assert f"{array.name!r} is mirrored" in found(scene, "mirror").reason


def test_array_without_a_direction_is_one_sentence(scene):
    array = rig.find(scene)
    array.scale = (0, 0, 0)
    bpy.context.view_layer.update()
    assert scene.lfsr.distance == 0
    refuses("has no direction.*set the scale to 1", place, scene)
    panel.refused("has no direction", bpy.ops.lfsr.array_fit)
    assert "has no direction" in found(scene, "rig").reason


def test_spacing_flattens_and_deepens(scene):
    full, _ = place(scene)
    scene.lfsr.spacing = 0.5
    half, _ = place(scene)
    assert half.spacing == pytest.approx(full.spacing / 2)
    near, far = rig.usable_depth(full, MINI)
    nearer, farther = rig.usable_depth(half, MINI)
    assert nearer < near and farther > far


def test_usable_depth_is_the_displays(scene):
    array, _ = place(scene)
    front, behind = MINI.depth_range_mm()
    unit = array.distance / MINI.viewing_distance_mm
    near, far = rig.usable_depth(array, MINI)
    assert array.distance - near == pytest.approx(front * unit, rel=1e-4)
    assert far - array.distance == pytest.approx(behind * unit, rel=1e-4)


def test_the_array_is_saved_with_the_file(scene, tmp_path):
    scene.lfsr.distance, scene.lfsr.spacing, scene.lfsr.samples = 3.25, 0.75, 33
    expected = place(scene)
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene = bpy.context.scene
    assert place(scene)[0].distance == pytest.approx(expected[0].distance)
    assert np.allclose(place(scene)[1], expected[1])
    assert (scene.lfsr.distance, scene.lfsr.spacing) == (pytest.approx(3.25), pytest.approx(0.75))
    assert (scene.lfsr.samples, scene.lfsr.quality) == (33, "CUSTOM")
