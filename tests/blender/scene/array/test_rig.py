"""The camera array as scene data: moved, saved, chosen; what the render makes of it."""

import operator

import bpy
import numpy as np
import pytest

from blender_addon.scene.array import edit, rig
from tests.support import panel
from tests.support.scenes import MINI
from tests.support.told import refuses


@pytest.fixture
def scene(artist):
    """An artist's scene whose last step can be undone."""
    bpy.ops.ed.undo_push(message="the array")
    return artist


def place(scene):
    return rig.placement(scene, MINI)


def test_an_array_without_a_direction_is_one_sentence_and_moves_along_its_view(scene):
    array = rig.find(scene)
    array.rotation_euler, array.scale, scene.lfsr.distance = (0.4, 0.3, 1.2), (2, 2, 2), 3.0
    assert scene.lfsr.distance == pytest.approx(3.0, rel=1e-5)
    plane = rig.plane_of(array)
    ahead = array.matrix_world.translation - array.matrix_world.normalized().col[2].to_3d() * 3.0
    assert (plane.matrix_world.translation - ahead).length < 1e-4 and tuple(plane.lock_location) == (True, True, False)
    array.scale = (0, 0, 0)
    bpy.context.view_layer.update()
    assert scene.lfsr.distance == 0
    refuses("has no direction.*set the scale to 1", place, scene)
    panel.refused("has no direction", bpy.ops.lfsr.array_fit)
    assert "has no direction" in panel.problem_of(scene, "rig").reason


@pytest.mark.parametrize("whose", ["array", "parent"])
def test_mirror_of_an_array_is_undone(scene, whose):
    array, parent = rig.find(scene), bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    array.parent, before = parent, place(scene)
    {"array": array, "parent": parent}[whose].scale.x *= -1
    bpy.context.view_layer.update()
    after, matrix = place(scene)
    assert after.distance == pytest.approx(before[0].distance)
    assert np.linalg.det(np.array(matrix)[:3, :3]) == pytest.approx(-1), "array space is left-handed, as before"
    assert np.array(matrix)[:3, 2] == pytest.approx(np.array(before[1])[:3, 2], abs=1e-6)
    scene.lfsr.distance = 3.0
    assert scene.lfsr.distance == pytest.approx(3.0, rel=1e-5)
    assert f"{array.name!r} is mirrored" in panel.problem_of(scene, "mirror").reason


def test_usable_depth_is_the_displays_the_plane_keeps_the_framing_and_spacing_flattens_and_deepens(scene):
    array, _ = place(scene)
    unit = array.distance / MINI.viewing_distance_mm
    for scale in (1, 2):
        (front, behind), (near, far) = MINI.depth_range_mm(scale), rig.usable_depth(array, MINI, scale)
        assert array.distance - near == pytest.approx(front * unit, rel=1e-4)
        assert far - array.distance == pytest.approx(behind * unit, rel=1e-4)
    scene.lfsr.distance = 2 * array.distance
    after, _ = place(scene)
    assert after.distance == pytest.approx(2 * array.distance, rel=1e-5)
    assert after.half_width / after.distance == pytest.approx(array.half_width / array.distance, rel=1e-5)
    assert after.spacing == pytest.approx(2 * array.spacing, rel=1e-5)
    scene.lfsr.spacing = 0.5
    half, _ = place(scene)
    assert half.spacing == pytest.approx(after.spacing / 2)
    (near, far), (nearer, farther) = rig.usable_depth(after, MINI), rig.usable_depth(half, MINI)
    assert nearer < near and farther > far


def test_the_array_is_saved_with_the_file(scene, tmp_path):
    scene.lfsr.distance, scene.lfsr.spacing, scene.lfsr.samples = 3.25, 0.75, 33
    expected = place(scene)
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene = bpy.context.scene
    assert place(scene)[0].distance == pytest.approx(expected[0].distance) and np.allclose(place(scene)[1], expected[1])
    assert (scene.lfsr.distance, scene.lfsr.spacing) == (pytest.approx(3.25), pytest.approx(0.75))
    assert (scene.lfsr.samples, scene.lfsr.quality) == (33, "CUSTOM")


def same() -> tuple[str | None, str | None]:
    """Names of array and plane that are drawn; they are those that a search finds."""
    scene = bpy.context.scene
    bpy.context.view_layer.update()  # as before every redraw
    array, plane = rig.drawn(scene)
    assert (array, plane) == (rig.find(scene), rig.plane_of(rig.find(scene)))
    assert (scene.lfsr.distance, scene.lfsr.spacing) == pytest.approx((rig.distance_to(plane), rig.spacing_of(array)))
    return array and array.name, plane and plane.name


def second_array(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    """Another array of the scene."""
    (array := edit._new_array(scene)).name = name
    return array


def test_nothing_is_searched_until_objects_come_or_go(scene):
    assert same() == ("Light Field Array", "Display Plane")
    entry = rig._found[scene.session_uid]
    scene.lfsr.distance *= 2
    scene.lfsr.spacing, bpy.data.objects["Box"].location.x = 0.5, 1
    scene.frame_set(7)
    assert same() == ("Light Field Array", "Display Plane") and rig._found[scene.session_uid] is entry


def test_undo_redo_and_another_file(scene, tmp_path):
    assert same()[0]
    bpy.ops.lfsr.array_remove()
    bpy.ops.ed.undo_push(message="no array")
    assert same() == (None, None)
    bpy.ops.ed.undo()
    assert same() == ("Light Field Array", "Display Plane")
    bpy.ops.ed.redo()
    assert same() == (None, None)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert same() == (None, None)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert same() == ("Light Field Array", "Display Plane")


def test_another_scene(scene):
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    assert same() == (None, None)
    second_array(other, "Its Array")
    assert same()[0] == "Its Array"
    bpy.context.window.scene = scene
    assert same()[0] == "Light Field Array"
    bpy.context.window.scene = other
    bpy.data.scenes.remove(scene)
    assert same()[0] == "Its Array"


def test_an_array_that_is_unlinked_or_becomes_an_ordinary_camera(scene):
    array, objects = rig.find(scene), scene.collection.objects
    for taken, given_back in ((lambda: objects.unlink(array), lambda: objects.link(array)),
                              (lambda: rig.forget(scene), lambda: operator.setitem(array, rig.SPACING, 1.0))):
        scene.camera = None
        assert same()[0]
        taken()
        assert same()[0] is None
        given_back()
        assert same()[0]


def test_names_and_the_active_camera_decide_between_two(scene):
    scene.camera = None
    second, name = second_array(scene, "Zebra"), "Light Field Array"
    scene.camera = None
    assert same()[0] == name
    second.name = "Aardvark"
    assert same()[0] == "Aardvark"
    bpy.data.objects[name].name = "A"
    assert same()[0] == "A"
    scene.camera = second
    assert same()[0] == "Aardvark"


def test_a_plane_that_belongs_to_another_array_and_deletion(scene):
    array, plane = rig.drawn(scene)
    plane.parent = None
    assert same() == (array.name, None)
    plane.parent = array
    assert same() == (array.name, plane.name)
    bpy.data.objects.remove(bpy.data.objects["Display Plane"])
    assert rig.drawn(scene)[1] is None, "also before an update"
    assert same() == ("Light Field Array", None)
    bpy.data.objects.remove(bpy.data.objects["Light Field Array"])
    assert rig.drawn(scene)[0] is None and same() == (None, None)
    assert scene.lfsr.distance == 0 and scene.lfsr.spacing == 1


def test_a_render_farm_that_tells_of_no_changes(tmp_path):
    with panel.registered():
        panel.artist_scene(tmp_path)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert rig.drawn(bpy.context.scene)[0] == rig.find(bpy.context.scene)
    bpy.data.objects.remove(rig.find(bpy.context.scene))
    assert rig.drawn(bpy.context.scene)[0] is None
