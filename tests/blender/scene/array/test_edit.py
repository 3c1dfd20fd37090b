"""The camera array added, fitted and removed."""

import math

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.scene import contents
from blender_addon.scene.array import edit, placement, rig
from blender_addon.scene.array.placement import View
from lfsr_core.base.messages import Notice
from tests.support import panel
from tests.support.scenes import MINI, add_box, add_camera


def place(artist):
    return rig.placement(artist, MINI)


def test_add_takes_the_place_of_the_camera_and_keeps_the_selection(artist):
    edit.remove(artist)
    add_camera(artist, (0.2, -4, 0.1))
    expected = placement.place_array(artist, MINI, contents.find_subject(artist))
    assert bpy.ops.lfsr.array_add() == {"FINISHED"}
    array, matrix = place(artist)
    assert np.allclose(matrix, expected[1], atol=1e-5)
    for name in ("distance", "half_width", "half_height", "spacing"):
        assert getattr(array, name) == pytest.approx(getattr(expected[0], name), rel=1e-5), name
    assert artist.camera.name != "Light Field Array"
    assert rig.find(artist).is_property_overridable_library(f'["{rig.SPACING}"]'), "else an override's is lost"
    edit.remove(copy := artist.copy())
    assert rig.find(copy) is None and place(artist) is not None, "the other scene keeps its array and its plane"
    bpy.data.scenes.remove(copy)
    edit.remove(artist)
    bpy.context.view_layer.objects.active = box = bpy.data.objects["Box"]
    box.select_set(True)
    assert bpy.ops.lfsr.array_add() == {"FINISHED"}
    assert (bpy.context.selected_objects, bpy.context.active_object) == ([box], box)


def test_at_a_camera_that_moves_it_moves_along_and_what_has_no_key_yet_stays(artist):
    edit.remove(artist)
    camera, box = add_camera(artist, (0, -6, 0)), bpy.data.objects["Box"]
    for item, frame, x in ((camera, 1, 0), (camera, 20, 0.5), (box, 1, 0), (box, 20, 0.1)):
        item.location.x = x
        item.keyframe_insert("location", frame=frame)
    for camera.data.lens, frame in ((30, 1), (60, 20)):  # it zooms, too
        camera.data.keyframe_insert("lens", frame=frame)
    artist.frame_set(1)
    box.location.z = 0.2
    assert list(placement.sample_frames(artist))[-1] == 20 and box.location.z == pytest.approx(0.2)
    array = edit.add(artist, MINI)
    for frame, x, half_width in ((1, 0, place(artist)[0].half_width), (20, 0.5, place(artist)[0].half_width / 2)):
        artist.frame_set(frame)
        assert tuple(array.matrix_world.translation) == pytest.approx((x, -6, 0), abs=1e-5)
        assert place(artist)[0].half_width == pytest.approx(half_width)
    assert edit.fit(artist, MINI, [box]).parent is None and not array.data.animation_data.drivers
    for name in "AB":
        artist.timeline_markers.new(name, frame=1).camera = bpy.data.objects.new(name, camera.data)
    assert contents.left_out(artist) == [Notice("markers-ignored", {"names": ["A", "B"]})]
    artist.camera, box.location.z = camera, 0.3  # by hand, at the last frame that is sampled
    assert list(placement.sample_frames(artist)) and artist.camera == camera and box.location.z == pytest.approx(0.3)


def test_fit_keeps_the_direction_and_frames_the_selection(artist):
    (array := rig.find(artist)).rotation_euler = (math.radians(70), 0, math.radians(50))
    bpy.context.view_layer.update()
    turn, box = array.matrix_world.to_3x3(), add_box(artist, (7.0, 3.0, -2.0), (0.2, 0.9, 0.3))
    box.select_set(True)
    assert bpy.ops.lfsr.array_fit() == {"FINISHED"}
    assert np.allclose(array.matrix_world.to_3x3().normalized(), turn, atol=1e-5)
    beside, depths = seen_at(artist, [box.matrix_world @ mathutils.Vector(corner) for corner in box.bound_box])
    near, far = rig.usable_depth(place(artist)[0], MINI)
    assert 0.4 < np.abs(beside).max() < 1 and near < depths.min() and depths.max() < far


def test_what_cannot_be_added_or_fitted_is_said_and_remove_leaves_nothing(artist):
    panel.refused("has a camera array already", bpy.ops.lfsr.array_add)
    bpy.ops.object.select_all(action="DESELECT")
    panel.refused("Nothing with geometry is selected", bpy.ops.lfsr.array_fit)
    assert rig.is_array(artist.camera)
    panel.refused("is the camera array itself: make another camera active", bpy.ops.lfsr.array_fit, to="CAMERA")
    assert bpy.ops.lfsr.array_remove() == {"FINISHED"} and rig.find(artist) is None
    assert [item.name for item in bpy.data.objects] == ["Box", "Sun"] and not bpy.data.cameras
    panel.refused("has no camera array to remove", bpy.ops.lfsr.array_remove)


def test_fit_to_the_camera_is_where_a_new_array_would_stand(artist):
    add_camera(artist, (0.2, -4, 0.1)).data.clip_start = 0.01
    artist.objects["Box"].hide_set(True)  # renders show it
    assert bpy.ops.lfsr.array_fit(to="CAMERA") == {"FINISHED"} and artist.objects["Box"].hide_get()
    artist.objects["Box"].hide_set(False)
    fitted = place(artist)
    edit.remove(artist)
    expected = placement.place_array(artist, MINI, contents.find_subject(artist))
    assert np.allclose(fitted[1], expected[1], atol=1e-5)
    assert fitted[0].distance == pytest.approx(expected[0].distance, rel=1e-5)
    assert fitted[0].clip == expected[0].clip == pytest.approx((0.01, 1000))


def seen_at(artist, points):
    """World points (n, 3) as fractions of the display's half width and height, and their depths."""
    layout, matrix = place(artist)
    inside = np.c_[points, np.ones(len(points))] @ np.linalg.inv(np.array(matrix)).T
    half = np.array([layout.half_width, layout.half_height]) / layout.distance
    return inside[:, :2] / inside[:, 2:3] / half, inside[:, 2]


@pytest.mark.parametrize("aimed", [True, False])
def test_fit_to_a_perspective_view_shows_what_it_shows(artist, aimed):
    turn = mathutils.Euler((math.radians(75), 0, math.radians(0 if aimed else 180))).to_matrix().to_4x4()
    eye, artist.objects["Box"].hide_viewport = mathutils.Matrix.Translation((0, -4, 1)) @ turn, True  # renders show it
    edit.fit_to_view(artist, MINI, View(eye, 0.3, 5.0, (0.01, 100), True))
    beside, depths = seen_at(artist, [tuple(eye @ mathutils.Vector((0.3, 0.3 * 96 / 128, -1)))])
    assert np.allclose(beside, 1, atol=1e-4) and depths == pytest.approx(1, rel=1e-4)
    distance = place(artist)[0].distance
    # The plane stands in the box, or at the view's centre where the view shows nothing.
    assert distance == pytest.approx(5.0) if not aimed else 3.5 < distance < 4.5


def test_fit_to_a_parallel_view_shows_what_it_shows_at_its_centre(artist):
    centre = mathutils.Matrix.Translation((1, 2, 3)) @ mathutils.Euler((math.radians(90), 0, 0)).to_matrix().to_4x4()
    edit.fit_to_view(artist, MINI, View(centre, 2.0, 7.0, (0.01, 100), False))
    layout, matrix = place(artist)
    assert layout.half_width == pytest.approx(2) and np.allclose(np.array(matrix)[:3, 3], (1, 2 - layout.distance, 3))
    beside, depths = seen_at(artist, [(3, 2, 3), (1, 2, 3)])
    assert np.allclose(beside, [(1, 0), (0, 0)], atol=1e-4) and np.allclose(depths, layout.distance)


def box_at(low, high):
    return np.array([low, high], float)


def chosen(*boxes):
    """Which of the boxes are the main part."""
    return edit.main_part({f"{index}": np.array(box) for index, box in enumerate(boxes)})


THING, NEIGHBOUR = box_at((-1, -1, 0), (1, 1, 2)), box_at((2, -1, 0), (3, 1, 2))
FLOOR, BACKDROP = box_at((-30, -30, -0.1), (30, 30, 0)), box_at((-40, 30, -5), (40, 31, 60))
STRAY, BUILDING = box_at((500, 0, 0), (501, 1, 1)), box_at((-10, -10, 0), (10, 10, 15))


def test_floors_and_what_lies_far_away_are_not_the_main_part():
    assert chosen(THING) == ["0"] and chosen(THING, NEIGHBOUR) == ["0", "1"] and chosen(THING, FLOOR) == ["0"]
    assert chosen(FLOOR, THING, BACKDROP, NEIGHBOUR) == ["1", "3"] and chosen(BUILDING, STRAY) == ["0"]
    assert chosen(BUILDING, box_at((0, 0, 1), (1, 1, 2))) == ["0", "1"], "a part of it"
    assert chosen(BUILDING, box_at((0, 0, 0), (1, 1, 2))) == ["1"], "walls around a stage"
    assert chosen(BUILDING, np.add(BUILDING, (12, 0, 0)), box_at((0, 0, -9), (1, 0.5, -8))) == [*"012"], "not around"
    assert chosen(BUILDING, BUILDING * 1.1, THING / 10) == [*"012"] and chosen(BUILDING, THING / 10) == ["1"], "a bead"
    assert chosen(STRAY, THING, FLOOR, NEIGHBOUR) == ["1", "3"]
    road = box_at((4, -20, 0), (4.3, 20, 0.1))
    assert chosen(THING, road, FLOOR) == ["0"] and chosen(THING, road) == ["0", "1"], "a road, and a rod"
    pond, land = box_at((-6, -6, -0.8), (6, 6, 0.1)), box_at((-6, -6, -2), (6, 6, 0.1))
    assert chosen(THING, pond) == ["0"] and chosen(THING, land) == ["0", "1"], "a ground, and a landscape"
    assert chosen(land, *[np.add(THING, (0, step / 4, 0)) for step in range(10)]) == [*map(str, range(1, 11))], "a town"
    near, behind = box_at((-4, -4, -0.1), (4, 4, 0)), box_at((-4, 3, 0), (4, 3.2, 4))
    assert chosen(np.subtract(THING, (0, 0, 1.05)), near) == ["0", "1"], "a gear on its shaft"
    assert chosen(THING, near, behind) == ["0"], "a stage"
    assert chosen(THING, near, behind, box_at((-4, -4, 4), (4, 4, 4.1))) == ["0", "1", "2", "3"], "a room"


@pytest.mark.parametrize(("half", "place"), [
    ((0.5, 0.5, 0.5), lambda at: at.z <= 0.5 < at.x), ((2, 1, 0.01), lambda at: at.z > 0.5),
    ((0.2, 0.2, 2), lambda at: at.z <= 0.5), ((2, 2, 0.5), lambda at: at.z > 0.5),
    ((0.02, 2, 1), lambda at: abs(at.x) > 2)])
def test_what_is_flat_is_looked_at_from_above_and_what_is_wide_from_a_side_from_there(scene, half, place):
    box = add_box(scene, (0, 0, 0), half)
    assert place(edit.add(scene, MINI).matrix_world.translation)
    placed = rig.placement(scene, MINI)
    assert placed[0].distance == pytest.approx(placement.middle(placement.seen_depths(scene, placed, {box})))


@pytest.mark.parametrize("half", [(0.5, 0.5, 0.5), (0.2, 0.2, 2), (1.5, 0.3, 0.6)])
def test_no_view_lies_below_the_ground_on_which_the_subject_stands(scene, half):
    box, ground = add_box(scene, (0, 0, half[2]), half), add_box(scene, (0, 0, -0.01), (30, 30, 0.01))
    edit.fit(scene, MINI, [box])
    for array, matrix in (rig.placement(scene, MINI), edit.in_front(scene, MINI, {box, ground})):
        assert (np.array(matrix) @ (0, -array.spacing * MINI.views[1] / 2, 0, 1))[2] > 0


def test_what_comes_nearer_in_an_animation_is_looked_at_from_its_front(scene):
    figure, scene.frame_end = add_box(scene, (0, 0, 0), (0.3, 0.3, 0.9)), 24
    for frame, figure.location.y in ((24, -2.8), (1, 0)):
        figure.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    assert edit.in_front(scene, MINI, {figure})[1][1][3] < -2.8, "although it is nearer to an array behind it now"


def test_of_two_sides_that_with_more_shape_is_looked_at(scene):
    places = [(0.2 * (step % 2 - 1), step / 8 - 1, z) for step in range(17) for z in (-1, 1)]
    mesh = bpy.data.meshes.new("Folded")
    mesh.from_pydata([*places, (0.1, -1, -1), (0.1, -1, 1), (0.1, 1, -1), (0.1, 1, 1)], [], [
        *((at, at + 1, at + 3, at + 2) for at in range(0, 32, 2)), (34, 35, 37, 36)])
    item = bpy.data.objects.new("Folded", mesh)
    scene.collection.objects.link(item)
    item.hide_set(True)  # in the viewport alone
    assert edit.add(scene, MINI).matrix_world.translation.x < -1 and item.hide_get(), "not the flat one"


@pytest.mark.parametrize(("boxes", "is_above"), [(6, True), (0, False)])
def test_an_island_is_looked_at_from_above_the_sea_and_what_is_in_the_sea_from_below_it(scene, boxes, is_above):
    bpy.ops.mesh.primitive_plane_add(size=400)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=3, location=(0, 0, -2 if is_above else -2.9))
    for number in range(boxes):
        add_box(scene, (-1 + 0.4 * number, 0, 2), (0.2, 0.2, 1))
    assert (edit.in_front(scene, MINI, {*scene.objects})[1][2][3] > 0) == is_above


def seen_box(scene, item):
    """What the array sees of a box: greatest offset as a fraction of half the display, and rays that meet it."""
    points = [item.matrix_world @ mathutils.Vector(corner) for corner in item.bound_box]
    return np.abs(seen_at(scene, points)[0]).max(), len(placement.seen_depths(scene, place(scene), {item}))


def test_a_bare_path_is_not_fitted_and_a_curve_that_shows_is(scene):
    box, path = add_box(scene, (0, 0, 0), (1, 1, 1)), bpy.data.objects.new("Path", bpy.data.curves.new("Path", "CURVE"))
    path.data.splines.new("POLY").points.add(1)
    path.data.splines[0].points[1].co = (99, 0, 0, 1)
    scene.collection.objects.link(path)
    for depth, shown in ((0.0, {box}), (0.1, {box, path})):
        path.data.bevel_depth = depth
        bpy.context.view_layer.update()
        assert edit.boxes_now({*scene.objects}).keys() == shown
        assert (np.concatenate([*placement.world_points({*scene.objects})]).max() > 50) == (path in shown)
    assert [len(points) for points in placement.world_points({*scene.objects}, 1e3)] == [8, 8], "corners of boxes"


@pytest.mark.parametrize("camera", [None, "PERSP", "PANO"])
def test_without_a_camera_that_sees_it_the_subject_fills_the_display(scene, camera):
    box = add_box(scene, (3.0, 2.0, 1.0), (0.5, 0.5, 0.5))
    if camera != "PERSP":  # the camera, which is turned away, would see the floor
        add_box(scene, (0, 0, -0.2), (60, 60, 0.1))
    if camera is not None:
        own = add_camera(scene, (0, -4, 0))
        own.data.type, own.rotation_euler = camera, (np.pi / 2, 0, np.pi)
    edit.add(scene, MINI)
    widest, rays = seen_box(scene, box)
    assert 0.4 < widest < 1 and rays > 50


def test_the_array_turns_where_a_wall_hides_the_subject(scene):
    box = add_box(scene, (0.0, 0.0, 0.0), (0.5, 0.5, 0.5))
    add_box(scene, (0.0, -0.8, 0.0), (0.1, 30.0, 30.0)).rotation_euler = (0, 0, np.pi / 2)
    edit.add(scene, MINI)
    assert seen_box(scene, box)[1] > 50
