"""The camera array added, fitted and removed."""

from __future__ import annotations

import math

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.array import edit, placement, rig
from blender_addon.scene import subject
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
    toward = mathutils.Matrix(matrix).inverted() @ box.matrix_world
    seen = np.array([toward @ mathutils.Vector(corner) for corner in box.bound_box])
    across = np.abs(seen[:, 0]) / seen[:, 2] * layout.distance / layout.half_width
    up = np.abs(seen[:, 1]) / seen[:, 2] * layout.distance / layout.half_height
    assert across.max() < 1 and up.max() < 1 and max(across.max(), up.max()) > 0.4
    near, far = rig.usable_depth(layout, MINI)
    assert near < seen[:, 2].min() and seen[:, 2].max() < far


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


def test_nothing_selected_is_reported(scene):
    for item in scene.objects:
        item.select_set(False)
    with pytest.raises(RuntimeError, match="Nothing is selected"):
        bpy.ops.lfsr.array_fit()
