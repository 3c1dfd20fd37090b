"""The camera array as scene data: added, fitted, moved, saved, removed; what the render makes of it."""

from __future__ import annotations

import math

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.array import edit, placement, rig
from blender_addon.scene import subject
from blender_addon.ui import overlay
from lfsr_core.optics.display import load_display
from tests.support import panel
from tests.support.scenes import add_box, add_camera

MINI = load_display("mini")


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


def place(scene):
    return rig.placement(scene, MINI)


def test_add_takes_the_place_of_the_camera(scene):
    edit.remove(scene)
    add_camera(scene, (0.2, -4, 0.1))
    expected = placement.place_array(scene, MINI, subject.find_subject(scene))
    assert bpy.ops.lfsr.array_add() == {"FINISHED"}
    array, matrix = place(scene)
    assert np.allclose(matrix, expected[1], atol=1e-5)
    for name in ("distance", "half_width", "half_height", "spacing"):
        assert getattr(array, name) == pytest.approx(getattr(expected[0], name), rel=1e-5), name
    assert scene.camera.name != "Light Field Array"


def test_the_render_uses_the_array(scene):
    scene.lfsr.distance = 2.5
    array, matrix = placement.place_array(scene, MINI, subject.find_subject(scene))
    assert array.distance == pytest.approx(2.5)
    assert (array, matrix) == place(scene)


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


def test_fit_keeps_the_direction_and_frames_the_selection(scene):
    array = rig.find(scene)
    array.rotation_euler = (math.radians(70), 0, math.radians(50))
    bpy.context.view_layer.update()
    turn = array.matrix_world.to_3x3()
    box = add_box(scene, (7.0, 3.0, -2.0), (0.2, 0.9, 0.3))
    box.select_set(True)
    assert bpy.ops.lfsr.array_fit() == {"FINISHED"}
    assert np.allclose(array.matrix_world.to_3x3().normalized(), turn, atol=1e-5)
    layout, matrix = place(scene)
    seen = np.array([rig.to_array_space(matrix) @ box.matrix_world @ mathutils.Vector(c) for c in box.bound_box])
    across = np.abs(seen[:, 0]) / seen[:, 2] * layout.distance / layout.half_width
    up = np.abs(seen[:, 1]) / seen[:, 2] * layout.distance / layout.half_height
    assert across.max() < 1 and up.max() < 1 and max(across.max(), up.max()) > 0.4
    near, far = rig.usable_depth(layout, MINI)
    assert near < seen[:, 2].min() and seen[:, 2].max() < far


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


def test_remove_leaves_nothing(scene):
    assert bpy.ops.lfsr.array_remove() == {"FINISHED"}
    assert rig.find(scene) is None
    assert [item.name for item in bpy.data.objects] == ["Box", "Sun"] and not bpy.data.cameras
    with pytest.raises(RuntimeError, match="has no camera array to remove"):
        bpy.ops.lfsr.array_remove()


def test_undo_brings_the_array_back(scene):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.lfsr.array_remove()
    bpy.ops.ed.undo_push(message="removed")
    bpy.ops.ed.undo()
    assert rig.find(bpy.context.scene) is not None


def test_a_second_array_is_refused(scene):
    with pytest.raises(RuntimeError, match="has a camera array already"):
        bpy.ops.lfsr.array_add()


def test_nothing_selected_is_told(scene):
    for item in scene.objects:
        item.select_set(False)
    with pytest.raises(RuntimeError, match="nothing is selected"):
        bpy.ops.lfsr.array_fit()


def test_the_active_camera_decides_between_two_arrays(scene):
    first = rig.find(scene)
    second = edit._new_array(scene)
    scene.camera = second
    assert rig.find(scene) == second
    scene.camera = first
    assert rig.find(scene) == first


def test_the_drawn_frustum_is_the_array(scene):
    array, _ = place(scene)
    near, far = rig.usable_depth(array, MINI)
    drawn = overlay.lines(array, MINI, scale=2)
    depths = {round(float(z), 4) for *_, points in drawn for z in points[:, 2]}
    sparse = rig.usable_depth(array, MINI, 2)
    assert {round(z, 4) for z in (0.0, near, array.distance, far, *sparse)} == depths
    rectangle = overlay.rectangle(array, array.distance)
    assert np.allclose(np.abs(rectangle), [(array.half_width, array.half_height, array.distance)] * 4)
    zone = overlay.viewing_zone(array, MINI)
    assert np.abs(zone[:, 0]).max() == pytest.approx(MINI.views[0] * array.spacing / 2)
