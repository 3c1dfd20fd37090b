"""The look before a render: what the array sees of scenes that nobody has prepared, and what mends it."""

import itertools
import re

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.check import look
from blender_addon.jobs import session
from blender_addon.render.frame_folder import light_seen
from blender_addon.scene import settings as scene_settings
from blender_addon.scene.array import edit, placement, rig
from blender_addon.scene.array.placement import Rays
from blender_addon.scene.contents import find_subject, with_copied
from blender_addon.scene.light import add_light
from blender_addon.ui.operators.check import FIXES
from blender_addon.ui.operators.render import check_questions
from tests.support import panel
from tests.support.scenes import add_camera, emission


@pytest.fixture
def startup():
    """Blender's new file, with its cube, lamp and camera, for the display that it begins with."""
    with panel.registered():
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        yield bpy.context.scene


def add_box(centre, half):
    """A closed box, which is selected alone, as importers leave what they bring."""
    return bpy.ops.mesh.primitive_cube_add(size=2, location=centre, scale=half) and bpy.context.object


def looked(scene, mends: bool = False) -> dict[str, str]:
    """Reasons by code, after an array was added as a render does; ``mends``: what the dialog offers is done in turn."""
    if rig.find(scene) is None:
        edit.add(scene, scene_settings.display_of(scene))
    bpy.context.view_layer.update()
    problems = list(look.find(scene))
    for problem in [problem for problem in problems if mends and problem.fix]:
        FIXES[problem.code](scene, problem.target, *filter(None, [problem.placed]))
    return {problem.code: problem.reason for problem in problems}


def mend(scene) -> dict[str, str]:
    """Do what the dialog offers until nothing is left to offer; return the reasons by code."""
    reasons = looked(scene, mends=True)
    assert not any(problem.fix for problem in look.find(scene))
    return reasons


def share_of(scene, *items) -> float:
    """Fraction of the picture that objects fill."""
    placed = rig.placement(scene, scene_settings.display_of(scene))
    return len(placement.seen_depths(scene, placed, {*items})) / np.prod(placement.PROBES)


def test_a_new_file_as_it_is_and_a_camera_that_was_aimed_stay(startup):
    assert looked(startup) == {}
    things = [add_box(at, (0.5, 0.5, 0.5)) for at in itertools.product(range(-2, 3), (-1, 1), (0,))]
    for height, is_cut in ((0, False), (1.4, True)):
        things[0].location.z += height
        assert ("frame" in looked(startup)) == is_cut, "its highest corner is outside"
    bpy.data.batch_remove(things)
    bpy.data.objects["Cube"].modifiers.new("Build", "BUILD").frame_start = 10
    assert "Frame 1" in looked(startup)["nothing"]
    box = aimed(startup)
    for box.scale, codes in (((0.2, 0.2, 0.2), {"frame"}), ((1, 1, 1), set())):
        assert looked(startup).keys() == codes, "less than 1 % of the picture is fitted"
    startup.collection.objects.link(copies := bpy.data.objects.new("Copies", None))
    copies.instance_collection = box.users_collection[0]
    for copies.instance_type in ("COLLECTION", "NONE"):
        box.hide_set(True)
        assert ("hidden" in looked(startup)) == (copies.instance_type == "NONE"), "where the viewport shows no copy"
    box.data.clear_geometry()
    box.data.from_pydata([(0, 0, 0), (0, 0, 1)], [], [])
    assert "Mesh to Points" in looked(startup)["nothing"]


@pytest.mark.parametrize(("centre", "half"), [
    ((0, 0, 0), (0.01, 0.01, 0.01)), ((0.5, 1.5, 0), (0.15, 0.15, 0.15)), ((90, 40, 0), (2, 2, 2)),
    ((0, 0, 0), (60, 60, 60)), (CUT := (4, -4.2, 3), (0.8,) * 3), ((4, -4.3, 3), (0.8,) * 3), ((0, 0, 0), (0.8,) * 3)])
def test_a_camera_that_nobody_aimed_is_fitted_to_what_was_imported(startup, centre, half):
    box, reasons = add_box(centre, half), looked(startup)
    assert "cube" in reasons and ("stands inside" if half[0] > 9 else "not aimed at Cube.001.") in reasons["frame"]
    mend(startup)
    assert bpy.data.objects["Cube"].hide_render and share_of(startup, box) > 0.2
    bpy.data.objects["Cube"].hide_render = False
    edit.remove(startup)
    startup.camera.location.z, startup.camera.rotation_euler.y = 5.5, 0.0108
    assert "cube" in (reasons := looked(startup)), "moved, and as old files turned it"
    assert ("frame" in reasons) == (centre != CUT), "an eighth may be outside, a quarter not"
    bpy.data.objects["Cube"].active_material.name = "Brick"
    assert "cube" not in looked(startup), "it is the artist's"


def test_colors_of_vertices_and_materials_of_alpha_0_are_shown(startup):
    colors = (box := add_box((0, 0, 0), (2, 2, 2))).data.color_attributes.new("Col", "FLOAT_COLOR", "POINT").data
    colors.foreach_set("color", [0.1, 0.3, 0.1, 1] * len(colors))
    assert "gray" in mend(startup)["colors"]
    (alpha := box.active_material.node_tree.nodes["Principled BSDF"].inputs["Alpha"]).default_value = 0
    assert "1 material" in mend(startup)["alpha"] and alpha.default_value == 1
    light, color = light_seen(startup, scene_settings.resolve(startup).request)
    assert np.median(color / light) == pytest.approx(0.3, abs=0.05), "a gray surface would send 0.8 of the light"


def test_creases_are_darkened_where_nothing_has_a_color(startup):
    floor = add_box((0, 0, -1.2), (4, 4, 0.2))
    shelves = [add_box((x, 0, 0.5), (0.1, 0.7, 1.5)) for x in np.linspace(-2, 2, 9)]
    shelves[4].data.materials.append(paint := bpy.data.materials.new("Paint"))
    before, shader = looked(startup), paint.node_tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value = 1
    assert "crease" in before and "crease" in looked(startup) and look.plain_shader(paint) is None, "one is of metal"
    light, color = light_seen(startup, scene_settings.resolve(startup).request)
    assert np.percentile(color / light, 10) == pytest.approx(0.8, abs=0.1)
    mend(startup)
    light, color = light_seen(startup, scene_settings.resolve(startup).request)
    assert np.percentile(color / light, 10) < 0.5 and np.percentile(color / light, 95) > 0.7
    assert not shader.inputs["Base Color"].is_linked and [slot.name for slot in shelves[1].material_slots] == ["Clay"]
    for (slot,) in (item.material_slots for item in (floor, *shelves)):
        slot.material, slot.link, slot.material = bpy.data.materials.new("Bare"), "OBJECT", paint
    assert "crease" not in looked(startup)


def test_what_helps_while_modelling_is_left_out(startup):
    """Volumes are drawn as wires too, and things that take long: they have a material, or a simulation."""
    subject, tool, hull, cloud, smoke, shape = items = [add_box((4 * at, 0, 0), (1, 1, 1)) for at in range(6)]
    bpy.ops.object.armature_add()
    bpy.context.object.pose.bones[0].custom_shape, subject.modifiers.new("Cut", "BOOLEAN").object = shape, tool
    hull.display_type = cloud.display_type = smoke.display_type = "WIRE"
    cloud.data.materials.append(bpy.data.materials.new("Cloud"))
    smoke.modifiers.new("Fluid", "FLUID")
    assert not {tool, hull, shape} & set(look.main_objects(startup, set(items)))
    assert "and 2 other objects" in mend(startup)["helper"]
    assert [item.hide_render for item in items] == [False, True, True, False, False, True]


def test_what_is_rendered_is_looked_at_whatever_the_viewport_hides(startup):
    wall = aimed(startup)
    blocker, folder = add_box((0, -6, 1), (0.11, 0.11, 0.11)), bpy.data.collections.new("Folder")
    startup.collection.children.link(folder)
    folder.objects.link(blocker)
    blocker.users_collection[0].objects.unlink(blocker)
    layer = bpy.context.view_layer.layer_collection.children["Folder"]
    for is_hidden in (True, False):
        blocker.hide_set(is_hidden)
        blocker.hide_render = not is_hidden
        blocker.select_set(not is_hidden)
        assert ("stands inside" in looked(startup).get("frame", "")) == is_hidden == blocker.hide_get()
        assert blocker.select_get() != is_hidden
    blocker.hide_render = False
    for is_hidden, owner in itertools.product((False, True), (layer, folder)):
        owner.hide_viewport, folder.hide_render = is_hidden, not is_hidden
        assert ("stands inside" in looked(startup).get("frame", "")) == is_hidden == owner.hide_viewport
        assert is_hidden or blocker.select_get()
        owner.hide_viewport = False
    folder.hide_render, above = False, bpy.data.collections.new("Above")
    startup.collection.children.link(above)
    above.children.link(folder)
    startup.collection.children.unlink(folder)
    for owner, name, value in ((above, "hide_render", True), (blocker, "visible_camera", False)):
        assert "stands inside" in looked(startup)["frame"]
        setattr(owner, name, value)
        assert "frame" not in looked(startup), name
        setattr(owner, name, not value)
    bpy.context.window.view_layer = other = startup.view_layers.new("Other")  # not the one that is rendered
    other.use, other.layer_collection.children["Above"].exclude = False, True
    assert "stands inside" in looked(startup)["frame"]
    above.hide_render, hair = True, wall.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings
    hair.type, hair.render_type, hair.instance_object, hair.particle_size = "HAIR", "OBJECT", blocker, 1
    assert "stands inside" not in looked(startup).get("frame", "")
    placed = rig.placement(startup, scene_settings.display_of(startup))
    with placement.as_rendered():
        depths = look.depths_of(Rays(startup), placed, with_copied({wall}))
    assert depths[0] < 5.45, "what is copied stands before the wall"


def test_what_blenders_camera_does_not_show_does_not_hide_the_picture_backs_in_eevee_or_before_clip_start(startup):
    box, around = aimed(startup), add_box((0, -6, 1), (0.4, 0.3, 0.3))
    around.data.materials.append(bpy.data.materials.new("Around"))
    for is_culled, engine in ((True, "CYCLES"), (False, startup.render.engine), (True, startup.render.engine)):
        around.active_material.use_backface_culling, startup.render.engine = is_culled, engine
        assert ("helper" in looked(startup)) == (is_culled and engine != "CYCLES")
    for clip_start in (0.1, 0.4, 0.1):  # its front stands at 0.3
        edit.remove(startup)
        startup.camera.data.clip_start = clip_start
        assert "frame" not in looked(startup) and (share_of(startup, box) > 0.1) == (clip_start == 0.4)
    box.hide_render = True
    assert "helper" not in looked(startup), "nothing else is there"
    box.hide_render = False
    assert "hides the picture" in mend(startup)["helper"] and share_of(startup, box) > 0.1 and around.hide_render


def move_far(scene):
    """Move all to where floats are coarse."""
    for item in (item for item in scene.objects if item.parent is None):
        item.location += mathutils.Vector((1e5, 1e5, 1e5))


def test_a_solid_box_of_wires_around_much_of_the_picture_is_left_out(startup):
    """Not smoke, a heavy thing, a box with nothing in it, or a room around the camera."""
    box, hull, _ = aimed(startup, half=(2, 1, 2)), add_box((0, 0, 1), (3, 3, 3)), add_box((0, 9, 1), (9, 0.1, 9))
    hull.data.materials.append(paint := bpy.data.materials.new("Paint"))
    for owner, name, *values in ((hull, "display_type", "SOLID", "WIRE"), (box, "hide_render", True, False),
                                 (hull, "scale", (9, 9, 9), (1, 1, 1))):
        for value, is_left_out in zip(values, (False, True), strict=True):
            setattr(owner, name, value)
            assert ("helper" in looked(startup)) == is_left_out, name
    hull.modifiers.new("Round", "SUBSURF")
    assert "helper" not in looked(startup)
    hull.modifiers.clear()
    for kind in ("BsdfTransparent", "VolumeScatter"):
        node = paint.node_tree.nodes.new(f"ShaderNode{kind}")
        assert "helper" not in looked(startup)
        paint.node_tree.nodes.remove(node)
    move_far(startup)
    assert "would be rendered solid" in mend(startup)["helper"] and hull.hide_render and not box.hide_render


def make_room(scene, lamp: bool) -> list[bpy.types.Object]:
    """Walls around 5 × 7 × 2.7 m, with a table and a bench, beside the new file's camera."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    items = [add_box(*place) for place in (
        ((0, 0, -0.1), (2.5, 3.5, 0.1)), ((0, 0, 2.8), (2.5, 3.5, 0.1)), ((-2.6, 0, 1.35), (0.1, 3.5, 1.6)),
        ((2.6, 0, 1.35), (0.1, 3.5, 1.6)), ((0, -3.6, 1.35), (2.7, 0.1, 1.6)), ((0, 3.6, 1.35), (2.7, 0.1, 1.6)),
        ((0, 1, 0.7), (0.7, 0.4, 0.03)), ((1.5, 1, 0.2), (0.3, 1.5, 0.2)))]
    for item in items:
        item.select_set(True)
        item.data.materials.append(bpy.data.materials.new(item.name))
    if lamp:
        scene.objects["Light"].location = (0, 0, 2.5)
    return items


def test_a_camera_that_nobody_aimed_does_not_look_at_the_backs_of_walls(startup):
    things = [add_box((x, y, 0), (0.2, 0.2, 0.2)) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    walls = add_box((1.5, 0, 0.5), (0.1, 1.5, 1)), add_box((0, -1.5, 0.5), (1.5, 0.1, 1))
    assert "not aimed" in mend(startup)["frame"] and share_of(startup, things[0]) > 0 < share_of(startup, walls[0])


@pytest.mark.parametrize(("lamp", "glow"), [(True, 0), (False, 0), (False, 1e-3)])
def test_of_a_room_the_inside_is_seen(startup, lamp, glow):
    items, startup.camera.data.type = make_room(startup, lamp), "ORTHO" if glow else "PERSP"
    bpy.context.object.active_material = material = bpy.data.materials.new("Glow")
    material.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = glow
    reasons = mend(startup)
    assert "not aimed" in reasons["frame"] and ("dark" in reasons) != lamp
    x, y, z = rig.find(startup).matrix_world.translation
    assert abs(x) < 2.5 and abs(y) < 3.5 and 0 < z < 2.7
    assert startup.lfsr.light == ("AUTO" if lamp else "EVEN"), "the light of a world does not reach a room"
    placed = rig.placement(startup, scene_settings.display_of(startup))
    assert np.median(placement.seen_depths(startup, placed, find_subject(startup))) > 2.5, "the longest view"
    items[4].location.z -= 2  # the wall behind the array
    for wall in items[1:6]:
        assert FIXES["dark"](startup, "") is None and startup.lfsr.light == "EVEN", "little sky lights what is seen"
        wall.visible_camera = False


def place_in_room(scene, items):
    """World matrix of a new array for ``items``, if it stands in their box."""
    bpy.context.view_layer.update()
    points = np.concatenate(list(edit.boxes_now(set(items)).values()))
    matrix = np.array(edit.in_front(scene, scene_settings.display_of(scene), set(items))[1])
    return matrix if ((matrix[:3, 3] > points.min(0)) & (matrix[:3, 3] < points.max(0))).all() else None


def test_in_a_hall_many_things_are_seen_from_the_height_of_eyes_not_a_round_one_close_by(startup):
    poles = [add_box((x, y, 1.2), (0.2, 0.2, 1.2)) for x in range(-10, 11, 4) for y in range(-10, 11, 4)]
    hall = add_box((0, 0, 3), (12, 12, 3))
    assert place_in_room(startup, [hall, *poles])[2, 3] == pytest.approx(edit.EYE_HEIGHT, abs=0.1)
    bpy.data.batch_remove([hall, *poles])
    hall = [add_box((x, y, 0.3), (0.4, 0.4, 0.3)) for x in range(-10, 11, 2) for y in range(-10, 11, 2)]
    hall.append(add_box((0, 0, 8), (12, 12, 8)))
    matrix = place_in_room(startup, hall)
    assert abs(matrix[2, 2]) < 0.5 and abs(matrix[0, 3]) in (0, pytest.approx(8.4)), "level, from few places"
    bpy.data.batch_remove(hall)
    things = [add_box((0, 0, 3.75), (7.5, 7.5, 3.75)), *(add_box((x, 4, 2), (0.5, 0.5, 2)) for x in (-4, -1, 2, 5))]
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    ball = bpy.ops.mesh.primitive_uv_sphere_add(location=(0, 0, 3.75)) and bpy.context.object
    assert np.linalg.norm(place_in_room(startup, [*things, ball])[:3, 3] - ball.location) > 5


@pytest.mark.parametrize("turn", [0, np.pi / 2])
def test_a_view_inside_a_room_shows_whole_things(startup, turn):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    shelf = [add_box((x, 2.4, 0.8), (0.2, 0.3, 0.8)) for x in np.linspace(-2, 2, 6)]
    room = [add_box((0, 0, 1.5), (4, 3, 1.5)), *shelf]
    for item in room:
        item.matrix_world = mathutils.Matrix.Rotation(turn, 4, "Z") @ item.matrix_world
    toward = np.linalg.inv(place_in_room(startup, room))
    x, y, z = toward[:3, :3] @ np.concatenate([*edit.boxes_now({*shelf}).values()]).T + toward[:3, 3:]
    assert (z > 0).all() and np.mean(np.maximum(abs(x), 16 / 9 * abs(y)) < edit.HALF_WIDTH * z) > 0.8


def test_a_solid_thing_and_a_dome_are_no_rooms(startup):
    """Nor is a cart, whose wheels reach into it."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    for radius in (2, 200):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=radius)
        assert place_in_room(startup, [bpy.context.object]) is None
        bpy.ops.object.delete()
    parts = [add_box((0, 0, 1), (1, 0.5, 0.5))]
    for x, y in ((-0.7, -0.5), (-0.7, 0.5), (0.7, -0.5), (0.7, 0.5)):
        bpy.ops.mesh.primitive_cylinder_add(location=(x, y, 0.4), radius=0.35, depth=0.2, rotation=(np.pi / 2, 0, 0))
        parts.append(bpy.context.object)
    assert place_in_room(startup, parts) is None


@pytest.mark.parametrize("is_one_mesh", [False, True])
def test_a_room_shows_more_inside_than_outside_unless_a_wall_is_missing(startup, is_one_mesh):
    items = make_room(startup, lamp=True)
    if is_one_mesh:
        items = bpy.ops.object.join() and [bpy.context.object]
    assert place_in_room(startup, items) is not None
    startup.unit_settings.scale_length = 0.1
    assert place_in_room(startup, items) is None, "nobody stands in so small a box"
    startup.unit_settings.scale_length = 1.0
    if not is_one_mesh:
        windows = [add_box((x, -3.75, z), (0.2, 0.05, 0.2)) for x in range(-2, 3) for z in (0.5, 1, 1.5)]
        assert place_in_room(startup, items + windows) is None, "it is a house"
        bpy.data.batch_remove(windows[3:])
        assert place_in_room(startup, items + windows[:3]) is None, "a plain one"
        bpy.data.batch_remove([*windows[:3], items.pop(4)])
        assert place_in_room(startup, items) is None
        matrix = edit.in_front(startup, scene_settings.display_of(startup), set(items))[1]
        assert matrix[1][3] < -3.6, "it is looked into"


def test_glass_in_a_world_of_one_colour_is_lit_by_an_image(startup):
    (goblet := bpy.data.objects["Cube"]).location.z = 0.1
    shader = goblet.active_material.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"]
    startup.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 20
    assert looked(startup) == {}
    shader.default_value = 1
    assert "Cube is of glass" in looked(startup)["dark"]
    wall = add_box((-12, 12, 0), (9, 9, 9))
    assert "dark" not in looked(startup), "it shows the wall"
    wall.hide_render = True
    move_far(startup)
    assert "Cube is of glass" in looked(startup)["dark"]
    add_light(startup)
    assert looked(startup) == {}


def test_a_stage_does_not_hide_what_stands_on_it(startup):
    bpy.ops.mesh.primitive_cylinder_add(radius=12, depth=8, location=(0, 0, 3), end_fill_type="NOTHING")
    car, wall, display = bpy.data.objects["Cube"], bpy.context.object, scene_settings.display_of(startup)
    depths = placement.seen_depths(startup, edit.in_front(startup, display, {car, wall}), {car})
    assert len(depths) > 0.1 * np.prod(placement.PROBES)


def test_a_globe_is_no_room_and_neither_a_thin_tail_nor_its_own_ground_makes_a_ring_small(startup):
    things = [bpy.data.objects["Cube"]]
    for metres in (100, 10, 1):
        bpy.data.batch_remove(things)
        bpy.ops.mesh.primitive_uv_sphere_add(radius=1.2 * metres)
        bpy.context.object.modifiers.new("Glass", "SOLIDIFY").thickness = 0.1 * metres
        things = [bpy.context.object, add_box((0, 0, -0.5 * metres), (0.5 * metres, 0.5 * metres, 0.2 * metres))]
        assert place_in_room(startup, things) is None
    bpy.data.batch_remove(things)
    bpy.ops.mesh.primitive_torus_add(location=(400, 0, 0))
    ring, tail = bpy.context.object, add_box((400, 0, -90), (0.01, 0.01, 90))
    assert "frame" not in mend(startup) and share_of(startup, ring) > 0.05 and share_of(startup, tail) < 0.05
    ring.rotation_euler.x = np.pi / 2
    add_box((400, 0, 0), (0.01, 90, 0.01)), ring.select_set(True), bpy.ops.object.join()
    assert place_in_room(startup, [bpy.context.object]) is None, "not in its tail"
    bpy.ops.mesh.primitive_torus_add(location=(0, 0, 0.3))
    ring = bpy.context.object
    add_box((0, 0, 0), (40, 30, 0.01)), ring.select_set(True), bpy.ops.object.join()
    assert edit.in_front(startup, scene_settings.display_of(startup), {bpy.context.object})[0].half_width < 4
    swords = ((0.03, 0.03, 0.15), (0.006, 0.002, 0.4)), ((0.08, 0.01, 0.01), (0.01, 0.002, 0.5))
    for (hilt, blade), turn in zip((*swords, swords[0]), (0, np.pi / 2, np.pi / 2), strict=True):
        bpy.ops.mesh.primitive_uv_sphere_add(scale=hilt, location=(0, 0, 50))
        add_box((0, 0, 50 + blade[2]), blade), bpy.data.objects["Sphere"].select_set(True), bpy.ops.object.join()
        (sword := bpy.context.object).rotation_euler.x = turn
        assert edit.in_front(startup, scene_settings.display_of(startup), {sword})[0].half_size[not turn] > 0.4


def test_a_shell_is_seen_from_its_front_and_a_solid_thing_whose_normals_point_inwards_as_any(startup):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_cone_add(end_fill_type="NOTHING", rotation=(-np.pi / 2, 0, 0))
    shell, parts = bpy.context.object, [add_box((0, y, 0), (2, 0.2, 1)) for y in (-0.3, 0.3)]
    parts[0].data.flip_normals()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=30, y_subdivisions=30)
    (hill := bpy.context.object).data.flip_normals()  # a landscape is seen from above, whatever its normals
    for point in hill.data.vertices:
        point.co.z = 0.25 * np.sin(4 * point.co.x) * np.cos(4 * point.co.y)
    for items, (row, column), more in (({shell}, (1, 2), False), ({*parts}, (1, 2), True), ({hill}, (2, 3), True)):
        for item in (shell, *parts, hill):
            item.hide_render = item not in items
        assert (edit.in_front(startup, scene_settings.display_of(startup), items)[1][row][column] > 0.5) == more


def test_what_travels_far_is_fitted_where_it_is(startup):
    ship = add_box((0, 0, 0), (1, 1, 1))
    for frame, ship.location.x in ((1, 0), (20, 400)):
        ship.keyframe_insert("location", frame=frame)
    startup.frame_set(20)
    assert "frame" in mend(startup) and share_of(startup, ship) > 0.2


def test_a_narrow_figure_is_seen_from_its_broad_side(startup):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1, location=(90, 0, 0.9), scale=(0.05, 0.16, 0.9))
    assert "frame" in looked(startup) and FIXES["frame"](startup, "") is None, "as a button of the panel does"
    assert abs(rig.find(startup).matrix_world.col[2].x) > 0.99


def test_what_came_since_the_file_was_opened_is_the_subject_and_softboxes_are_lamps(startup, tmp_path):
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    base, body = add_box((0, 0, -0.2), (1, 1, 0.2)), add_box((0, 0, 9), (0.4, 0.4, 0.9))
    assert set(look.main_objects(startup, {base, body})) == {base, body}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    scene, (base, body) = bpy.context.scene, [item for item in bpy.data.objects if item.type == "MESH"]
    assert body.select_get() and set(look.main_objects(scene, {base, body})) == {base, body}, "saved with its selection"
    softbox = add_box((0, 0, 20), (9, 9, 0.1))
    assert look.main_objects(scene, {base, body, softbox}) == [softbox], "as what was imported"
    softbox.data.materials.append(emission((1, 1, 1)))
    assert set(look.main_objects(scene, {base, body, softbox})) == {base, body}


def test_the_lamp_of_the_new_file_is_not_all_the_light_of_what_was_imported(startup):
    add_box((90, 40, 0), (2, 2, 2))
    assert "new file" in looked(startup)["dark"]
    bpy.context.object.active_material = shining = bpy.data.materials.new("Dark")
    inputs, soot = shining.node_tree.nodes["Principled BSDF"].inputs, shining.node_tree.nodes.new("ShaderNodeRGB")
    inputs["Emission Strength"].default_value, soot.outputs[0].default_value = 1e-3, (1e-4, 1e-4, 1e-4, 1)
    link, startup.objects["Light"].data.energy = shining.node_tree.links.new(soot.outputs[0], inputs["Base Color"]), 1e5
    assert "Hardly any" in looked(startup)["dark"], "it shines too little"
    shining.node_tree.links.remove(link)
    startup.objects["Light"].location = (88, 37, 5)
    assert "dark" not in looked(startup)


def aimed(scene, place=(0, -6, 1), half=(1, 0.5, 1)):
    """A box in a scene of its own camera, which looks along +Y, without the new file's cube."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.camera, scene.objects["Light"].location = add_camera(scene, place), (1, -5, 4)
    return add_box((0, 0, 1), half) if half else None


def test_an_aimed_camera_stays_where_nothing_is_larger_or_rays_do_not_tell_and_fog_gets_no_light(startup):
    near, far = aimed(startup, half=(0.05, 0.05, 0.05)), add_box((0, 90, 1), (0.05, 0.05, 0.05))
    assert "frame" not in looked(startup), "the array would see less of what is so deep"
    near.location.z, far.location = -9, (0, 1, -9)
    assert "sees nothing" in looked(startup)["frame"]
    near.active_material = made = bpy.data.materials.new("Made")
    made.displacement_method, nodes, link = "BOTH", made.node_tree.nodes, made.node_tree.links.new
    link(nodes.new("ShaderNodeDisplacement").outputs[0], nodes["Material Output"].inputs["Displacement"])
    assert "frame" not in looked(startup)
    made.displacement_method, near.location.z, near.scale = "BUMP", 1, (1, 1, 1)
    startup.objects["Light"].data.energy = 0.1
    assert "dark" in looked(startup)
    link(nodes.new("ShaderNodeVolumeScatter").outputs[0], nodes["Material Output"].inputs["Volume"])
    assert {*looked(startup)} & {"dark", "fog"} == {"fog"}
    add_box((0.4, -1, 1.4), (0.4, 0.1, 0.1)).data.materials.append(emission((1, 1, 1)))
    assert not {*looked(startup)} & {"dark", "fog"}, "a night"


def test_too_much_depth_names_its_numbers_and_is_flattened(startup):
    aimed(startup, half=())
    for y in range(0, 60, 5):
        add_box(((-1)**y * (0.7 + y / 8), y, 1), (0.5, 0.5, 1)).hide_set(y > 0)  # renders show them
    bpy.context.view_layer.update()
    before, reasons = {item.name: item.matrix_world.copy() for item in startup.objects}, mend(startup)
    assert set(reasons) == {"deep"} and re.search("before the display and.*\N{NO-BREAK SPACE}%", reasons["deep"])
    assert 0.2 < startup.lfsr.spacing < 0.9
    assert all(startup.objects[name].matrix_world == matrix for name, matrix in before.items()), "objects stay"


def test_a_display_plane_in_the_wrong_place_is_moved(startup):
    aimed(startup)
    assert looked(startup) == {}
    rig.set_distance(startup, 2.0)
    add_box((0.8, -6, 1), (0.5, 0.5, 0.5))
    assert set(mend(startup)) == {"plane"} and startup.lfsr.distance == pytest.approx(5.5, abs=0.3)
    array, _ = rig.placement(startup, display := scene_settings.display_of(startup))
    assert 0.2 < array.spacing * max(display.views) / 2 < 0.3, "up to that box"
    assert "almost flat" in looked(startup)["walls"]


@pytest.mark.parametrize(("energy", "world", "exposure", "code"), [
    (1000, 0, 0, ""), (2, 0, 0, "dark"), (2, 0.5, 0, ""), (2, 0, 8, ""), (0, 0.04, 0, "dark"), (2e4, 0, 0, ""),
    (2e4, 0, -6, ""), (-200, 0, 0, "dark")])
def test_hardly_any_light_is_noticed(startup, energy, world, exposure, code):
    aimed(startup)
    lamp, startup.view_settings.exposure = startup.objects["Light"], exposure
    # Rays cannot tell which lamps are hidden, and expect half more than what is dim.
    lamp.data.energy, lamp.visible_diffuse, lamp.location = abs(energy), energy >= 0, (1, -5, 4)
    nodes = startup.world.node_tree.nodes
    nodes["Background"].inputs["Color"].default_value, _ = (world, world, world, 1), nodes.new("NodeFrame")
    assert set(looked(startup)) == {code} - {""}
    if energy >= 1000 and not exposure:  # a render knows what a texture says: black paint, and bare metal
        bpy.context.object.active_material = paint = bpy.data.materials.new("Paint")
        shader, value = paint.node_tree.nodes["Principled BSDF"].inputs, paint.node_tree.nodes.new("ShaderNodeValue")
        shader["Roughness"].default_value, value.outputs[0].default_value = energy / 4e4, energy == 1000
        paint.node_tree.links.new(value.outputs[0], shader["Metallic" if energy == 1000 else "Base Color"])
        assert set(looked(startup)) == ({"dark"} if energy == 1000 else set())
    if code == "dark":
        mend(startup)
        assert startup.lfsr.light == "CITY"


def test_a_bright_sky_behind_dark_things_is_not_taken_away(startup):
    box, nodes, links = aimed(startup), startup.world.node_tree.nodes, startup.world.node_tree.links
    startup.objects["Light"].data.energy = 1  # and the sky lights nothing
    links.new(nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"], nodes["Background"].inputs["Strength"])
    assert "dark" not in looked(startup)
    startup.render.film_transparent = True
    assert "sky" not in looked(startup)["dark"]
    startup.render.film_transparent, box.scale = False, (1.5, 1, 1.2)
    assert "which then do not show the sky" in looked(startup)["dark"]


def test_a_world_whose_image_is_missing_is_offered_another_light(startup):
    aimed(startup)
    (node := startup.world.node_tree.nodes.new("ShaderNodeTexEnvironment")).image = bpy.data.images.new("sky.exr", 1, 1)
    assert "dark" not in looked(startup), "it is generated"
    node.image.source, node.image.filepath = "FILE", "/sky.exr"
    assert "sky.exr is missing" in looked(startup)["dark"]


@pytest.mark.parametrize("gray", [0.004, 0.4])
def test_black_things_need_more_light_to_be_seen(startup, gray):
    box, paint = aimed(startup), bpy.data.materials.new("Lacquer")
    paint.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (gray, gray, gray, 1)
    box.data.materials.append(paint)
    startup.objects["Light"].data.energy = 100
    assert ("dark" in looked(startup)) == (gray < 0.1)


@pytest.mark.parametrize(("glass", "linked"), [(False, False), (True, False), (True, True)])
def test_glass_on_velvet_under_lamps_alone_is_black(startup, glass, linked):
    """Nothing is around it that it could show, and velvet in the same light stays dark; linked nodes say otherwise."""
    for box, color, part in ((aimed(startup), 0.9, float(glass)), (add_box((0, 1, 1), (4, 0.1, 4)), 0.05, 0.0)):
        paint = bpy.data.materials.new("Paint")
        node = paint.node_tree.nodes["Principled BSDF"]
        node.inputs["Base Color"].default_value, node.inputs["Transmission Weight"].default_value = [color] * 4, part
        node.inputs["Roughness"].default_value = 1 - part
        if linked:
            none = paint.node_tree.nodes.new("ShaderNodeValue").outputs[0]  # 0
            paint.node_tree.links.new(none, node.inputs["Transmission Weight"])
        box.data.materials.append(paint)
    startup.objects["Light"].data.energy = 150
    assert ("dark" in looked(startup)) == (glass and not linked)


def test_the_dialog_offers_each_mend_ticked_and_asks_once(startup):
    add_box((90, 40, 0), (2, 2, 2))
    looked(startup)
    asked = check_questions(startup)
    assert [(question.mend, question.title) for question in asked[:2]] == [
        ("leave_out_cube", "Leave Out Cube"), ("fit_objects", "Fit to Objects")]
    for question in asked:
        question.accept()
    assert check_questions(startup) == [], "what was left as it is is not asked about again"


def test_a_script_mends_what_it_asks_for_alone(startup, tmp_path):
    box, lfsr = add_box((90, 40, 0), (2, 2, 2)), startup.lfsr
    lfsr.output, lfsr.display, lfsr.scale, lfsr.samples, lfsr.method = str(tmp_path), "mini", "2", 1, "bilinear"
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    assert share_of(startup, box) == 0 and not bpy.data.objects["Cube"].hide_render
    assert bpy.ops.lfsr.render_eia(fit_objects=True) == {"FINISHED"}
    assert share_of(startup, box) > 0.2 and not bpy.data.objects["Cube"].hide_render
    assert session.current() is None


@pytest.mark.parametrize("turned", [False, True])
def test_among_many_objects_rays_meet_what_they_meet_alone(startup, turned):
    ball = bpy.ops.mesh.primitive_uv_sphere_add(radius=1, location=(0, 0, 0)) and bpy.context.object
    ball.scale, ball.rotation_euler = (2, 1, 0.5), (0.3, 0.2, 0.1) if turned else (0, 0, 0)
    bpy.context.view_layer.update()
    ways = [mathutils.Vector(way) for way in np.random.default_rng(1).normal(size=(1000, 3))]
    few, start = Rays(startup), mathutils.Vector((4, 1, 2))
    expected = [few.cast(start, way) for way in ways]
    for _ in range(placement.FEW):
        (far := bpy.data.objects.new("far", ball.data)).location = 900, 900, 900
        startup.collection.objects.link(far)
    bpy.context.view_layer.update()
    startup.collection.objects.link(scatter := bpy.data.objects.new("scatter", bpy.data.meshes.new("none")))
    group = bpy.data.node_groups.new("nodes", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    kinds = "GeometryNodeMeshCube", "GeometryNodeGeometryToInstance", "NodeGroupOutput"
    for source, target in itertools.pairwise(group.nodes.new(kind) for kind in kinds):
        group.links.new(source.outputs[0], target.inputs[0])
    scatter.modifiers.new("Nodes", "NODES").node_group, scatter.location = group, (0, 0, 50)
    bpy.context.view_layer.update()
    many = Rays(startup)
    assert many.cast(mathutils.Vector((0, 0, 99)), mathutils.Vector((0, 0, -1)))[2] == scatter
    assert many.items and not few.items and sum(map(bool, expected)) > 20
    for way, hit in zip(ways, expected, strict=True):
        nearest = many.cast(start, way)
        assert (nearest is None) == (hit is None)
        if hit is not None:
            assert nearest[2] == hit[2] and (nearest[0] - hit[0]).length < 1e-4
            assert (nearest[1].dot(way) < 0) == (hit[1].dot(way) < 0)
