"""Where an array stands that nobody placed."""

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.scene.array import edit, placement, rig
from lfsr_core.optics.display import load_display
from tests.support.scenes import add_box, add_camera

MINI = load_display("mini")


def box_at(low, high):
    return np.array([low, high], float)


def chosen(*boxes):
    """Which of the boxes are the main part."""
    names = [f"{index}" for index in range(len(boxes))]
    return edit.main_part(names, np.array(boxes))


THING, NEIGHBOUR = box_at((-1, -1, 0), (1, 1, 2)), box_at((2, -1, 0), (3, 1, 2))
FLOOR, BACKDROP = box_at((-30, -30, -0.1), (30, 30, 0)), box_at((-40, 30, -5), (40, 31, 60))
STRAY, BUILDING = box_at((500, 0, 0), (501, 1, 1)), box_at((-10, -10, 0), (10, 10, 15))


def test_floors_and_what_lies_far_away_are_not_the_main_part():
    assert chosen(THING) == ["0"]
    assert chosen(THING, NEIGHBOUR) == ["0", "1"]
    assert chosen(THING, FLOOR) == ["0"]
    assert chosen(FLOOR, THING, BACKDROP, NEIGHBOUR) == ["1", "3"]
    assert chosen(BUILDING, STRAY) == ["0"]
    assert chosen(BUILDING, box_at((0, 0, 1), (1, 1, 2))) == ["0", "1"], "a part of it"
    assert chosen(STRAY, THING, FLOOR, NEIGHBOUR) == ["1", "3"]


def seen_box(scene, item):
    """What the array sees of a box: greatest offset as a fraction of half the display, and rays that meet it."""
    array = rig.placement(scene, MINI)
    toward = mathutils.Matrix(array[1]).inverted() @ item.matrix_world
    points = np.array([toward @ mathutils.Vector(corner) for corner in item.bound_box])
    half = np.array([array[0].half_width, array[0].half_height]) / array[0].distance
    return np.abs(points[:, :2] / points[:, 2:] / half).max(), len(placement.seen_depths(scene, array, {item}))


def turned_away(scene):
    add_camera(scene, (0, -4, 0)).rotation_euler = (np.pi / 2, 0, np.pi)


def parallel(scene):
    add_camera(scene, (0, -4, 0)).data.type = "ORTHO"


@pytest.mark.parametrize("camera", [None, turned_away, parallel])
def test_without_a_camera_that_sees_it_the_subject_fills_the_display(scene, camera):
    box = add_box(scene, (3.0, 2.0, 1.0), (0.5, 0.5, 0.5))
    if camera is not turned_away:  # the camera would see the floor
        add_box(scene, (0, 0, -0.2), (60, 60, 0.1))
    if camera is not None:
        camera(scene)
    bpy.context.view_layer.update()
    edit.add(scene, MINI)
    widest, rays = seen_box(scene, box)
    assert 0.4 < widest < 1 and rays > 50


def test_the_array_turns_where_a_wall_hides_the_subject(scene):
    box = add_box(scene, (0.0, 0.0, 0.0), (0.5, 0.5, 0.5))
    wall = add_box(scene, (0.0, -0.8, 0.0), (0.1, 30.0, 30.0))
    wall.rotation_euler = (0, 0, np.pi / 2)
    bpy.context.view_layer.update()
    edit.add(scene, MINI)
    assert seen_box(scene, box)[1] > 50
