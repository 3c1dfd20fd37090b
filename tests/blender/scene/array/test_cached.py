"""The array that panels draw is the scene's, whatever happened, and is not searched for again meanwhile."""

import operator

import bpy
import pytest

from blender_addon.scene.array import cached, edit, rig
from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        scene = panel.artist_scene(tmp_path)
        bpy.ops.ed.undo_push(message="the array")
        yield scene


def same() -> tuple[str | None, str | None]:
    """Names of array and plane that are drawn; they are those that a search finds."""
    scene = bpy.context.scene
    bpy.context.view_layer.update()  # as before every redraw
    array, plane = cached.array_and_plane(scene)
    assert (array, plane) == (rig.find(scene), rig.plane_of(rig.find(scene)))
    assert (scene.lfsr.distance, scene.lfsr.spacing) == pytest.approx((rig.distance_to(plane), rig.spacing_of(array)))
    return array and array.name, plane and plane.name


def second_array(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    """Another array of the scene."""
    array = edit._new_array(scene)
    array.name = name
    return array


def test_nothing_is_searched_until_objects_come_or_go(scene, monkeypatch):
    assert same() == ("Light Field Array", "Display Plane")
    monkeypatch.setattr(cached, "_search", lambda _: pytest.fail("it searches"))
    scene.lfsr.distance *= 2
    scene.lfsr.spacing, bpy.data.objects["Box"].location.x = 0.5, 1
    scene.frame_set(7)
    assert same() == ("Light Field Array", "Display Plane")


def test_undo_and_redo(scene):
    assert same()[0]
    bpy.ops.lfsr.array_remove()
    bpy.ops.ed.undo_push(message="no array")
    assert same() == (None, None)
    bpy.ops.ed.undo()
    assert same() == ("Light Field Array", "Display Plane")
    bpy.ops.ed.redo()
    assert same() == (None, None)


def test_another_file(scene, tmp_path):
    assert same()[0]
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


def test_deletion(scene):
    assert same()[1]
    bpy.data.objects.remove(bpy.data.objects["Display Plane"])
    assert cached.array_and_plane(scene)[1] is None, "also before an update"
    assert same() == ("Light Field Array", None)
    bpy.data.objects.remove(bpy.data.objects["Light Field Array"])
    assert cached.find(scene) is None and same() == (None, None)
    assert scene.lfsr.distance == 0 and scene.lfsr.spacing == 1


def test_an_array_that_is_unlinked_or_becomes_an_ordinary_camera(scene):
    array = rig.find(scene)
    for taken, given_back in ((lambda: scene.collection.objects.unlink(array),
                               lambda: scene.collection.objects.link(array)),
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


def test_a_plane_that_belongs_to_another_array(scene):
    array, plane = cached.array_and_plane(scene)
    plane.parent = None
    assert same() == (array.name, None)
    plane.parent = array
    assert same() == (array.name, plane.name)


def test_a_render_farm_that_tells_of_no_changes(tmp_path):
    with panel.registered():
        panel.artist_scene(tmp_path)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert cached.find(bpy.context.scene) == rig.find(bpy.context.scene)
    bpy.data.objects.remove(rig.find(bpy.context.scene))
    assert cached.find(bpy.context.scene) is None
