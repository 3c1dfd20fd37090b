"""Light for scenes that bring none, and what counts as light."""

import os
import re

import bpy
import mathutils
import numpy as np
import OpenImageIO as oiio
import pytest

from blender_addon.render import frame_folder
from blender_addon.render.output import heard, sample_fraction
from blender_addon.scene import light
from blender_addon.scene.files import open_scene
from blender_addon.scene.settings import color_settings
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import read_frame
from lfsr_core.images import image_files
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_camera, add_lamp, add_mesh, add_world, emission, mixed, save_box
from tests.support.told import Told, refuses


def test_scene_without_light_gets_an_hdri_that_is_not_seen(tmp_path):
    path = save_box(tmp_path / "scene.glb", (1.0, 2.0, 3.0), (0.5, 0.3, 0.4))
    scene = open_scene(path)
    job = make_request(str(tmp_path / "out"), MINI, scene=str(path), samples=4, world_visible=True)
    frame_folder.render_job(scene, job)
    layers = image_files.read_layers(tmp_path / "out" / "lr_eia.exr")
    alpha = layers["color"][..., 3]
    assert layers["color"][alpha == 1][:, :3].mean() > 0.05, "the box is lit"
    assert (alpha == 0).any() and np.all(layers["color"][alpha == 0] == 0) and read_frame(job.output).world_visible
    assert layers["environment"][alpha == 0].min() > 0 and layers["environment"][alpha == 1].max() == 0
    assert scene.world is None and not any("city" in image.name for image in bpy.data.images)


def test_a_world_image_lights_a_floor_as_view_transforms_can_show(scene, tmp_path):
    add_box(scene, (0, 0, 0), (2, 2, 0.01))
    color, _ = shown(scene, tmp_path, samples=16, light=light.DEFAULT_LIGHT)
    assert 0.35 < np.quantile(color.max(1), 0.75) < 0.5, "half of it is seen from below"


@pytest.mark.parametrize(("kind", "lit"), [
    ("nothing", False), ("lamp", True), ("hidden lamp", False), ("emission", True), ("black emission", False),
    ("world", True), ("black world", False), ("instanced lamp", True), ("lamp in a group off", False),
    ("grouped world", True), ("plain color world", True), ("copied emission", True)])
def test_what_counts_as_light(scene, kind, lit):
    material = emission((0, 0, 0) if "black" in kind else (1, 1, 1)) if "emission" in kind else None
    box = add_box(scene, (0, 0, 0), (1, 1, 1), material)
    if "copied" in kind:  # by geometry nodes, from a collection that is off
        off, copies = bpy.data.collections.new("off"), bpy.data.node_groups.new("copies", "GeometryNodeTree")
        scene.collection.children.link(off)
        off.hide_render, info = True, copies.nodes.new("GeometryNodeObjectInfo")
        off.objects.link(box)
        scene.collection.objects.unlink(box)
        copies.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = box, True
        copies.links.new(info.outputs["Geometry"], copies.nodes.new("NodeGroupOutput").inputs[0])
        add_box(scene, (3, 0, 0), (1, 1, 1)).modifiers.new("Copies", "NODES").node_group = copies
    if "lamp" in kind:
        lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
        lamp.hide_render = "hidden" in kind
        folder, empty = bpy.data.collections.new("group"), bpy.data.objects.new("empty", None)
        folder.objects.link(lamp)
        empty.instance_type, empty.instance_collection, folder.hide_render = "COLLECTION", folder, "off" in kind
        scene.collection.objects.link(empty) if "instanced" in kind else scene.collection.children.link(folder)
    if "world" in kind:
        world = add_world(scene, 0.5, 0 if "black" in kind else 1)
    if kind in ("grouped world", "plain color world"):
        tree, group = world.node_tree, bpy.data.node_groups.new("group", "ShaderNodeTree")
        inner, node = group.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeGroup")
        is_color = "color" in kind
        group.interface.new_socket("light", in_out="OUTPUT", socket_type=f"NodeSocket{('Shader', 'Color')[is_color]}")
        source = (group.nodes.new("ShaderNodeRGB") if is_color else inner).outputs[0]
        group.links.new(source, group.nodes.new("NodeGroupOutput").inputs[0])
        node.node_tree = group
        tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
        tree.nodes.remove(tree.nodes["Background"])
    assert light.has_light(scene) == lit


def with_sun(scene, strength):
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = strength, (1.0, 0, 0.3)
    scene.collection.objects.link(sun)


def shown(stage, tmp_path, **options):
    """Colours (n, 3) of the subject in a render, and what was said."""
    told = Told()
    frame_folder.render_job(stage, make_request(str(tmp_path / "out"), MINI, **{"samples": 1} | options), tell=told)
    color = image_files.read_layers(tmp_path / "out" / "lr_eia.exr")["color"]
    return color[color[..., 3] == 1][:, :3], " ".join(map(sentence, told.notices))


def lantern(scene):
    """A bright pane, too small to light the rest."""
    add_box(scene, (0, -0.5, 0), (0.1, 0.01, 0.1), emission((20, 20, 20)))


@pytest.mark.parametrize(("shine", "file"), [
    (lantern, ""), (lambda scene: with_sun(scene, 3 / 683), ""), (lantern, "scene.glb")])
def test_light_that_does_not_arrive_counts_as_none(scene, tmp_path, shine, file):
    """A .blend keeps its own light; files from elsewhere are lit."""
    box = add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.collection.children.link(bpy.data.collections.new("box"))
    scene.collection.children["box"].objects.link(box)
    shine(scene)
    assert light.has_light(scene)
    color, said = shown(scene, tmp_path, subject="box", scene=file)
    assert "lmost no light reaches" in said and ("lit with" in said) == bool(file)
    assert (np.median(color.max(-1)) > 0.05) == bool(file)
    frame, layers = read_frame(tmp_path / "out"), image_files.read_layers(tmp_path / "out" / "lr_eia.exr")
    assert (frame.light, frame.world_visible) == ("city" if file else "own", False) and "environment" not in layers
    assert scene.world is None and np.all(layers["color"][layers["color"][..., 3] == 0] == 0)


@pytest.mark.parametrize(("value", "exposure", "dark"), [(0.05, 0, True), (0.05, 2, False), (0.5, 0, False)])
def test_the_world_of_a_new_file_is_too_dark(scene, tmp_path, value, exposure, dark):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    add_world(scene, value)
    scene.view_settings.exposure = exposure
    _, said = shown(scene, tmp_path)
    assert ("lmost no light reaches" in said) == dark and light.is_certain(scene) != dark


def test_black_things_in_good_light_are_not_dark_nor_is_what_shines(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5), mixed(("ShaderNodeBsdfDiffuse", {"Color": (0.02, 0.02, 0.02, 1)})))
    for value, dim in ((1.0, False), (0.05, True)):
        add_world(scene, value)
        assert light.is_dim(*frame_folder.light_seen(scene, make_request(str(tmp_path), MINI))) == dim
    assert light.light_parts(frame_folder.added_light(scene, make_request(str(tmp_path), MINI)))[1] >= 4
    add_box(scene, (0, 0, 0), (0.6, 0.6, 0.6), emission((0.3, 0.3, 0.3)))
    assert shown(scene, tmp_path, scene="scene.glb")[1] == "" and read_frame(tmp_path / "out").light == "own"
    assert [light.is_dim(*[np.array([0.01] * 9 + [1])] * 2, is_night) for is_night in (False, True)] == [True, False]


def test_what_an_image_cannot_light_is_lit_evenly(scene, tmp_path):
    """A closed room, or a city in a box of sky. Its own world stays, as what windows show."""
    sky = add_world(scene, 0.5, 0.01)
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    add_box(scene, (0, 0, 0), (9, 9, 9))
    add_camera(scene, (0, -4, 0))
    (color, said), frame = shown(scene, tmp_path, scene="scene.glb"), read_frame(tmp_path / "out")
    assert "encloses it" in said and frame.light == "even" and frame.world_visible
    assert 0.05 < np.median(color.max(-1)) < 0.5, "walls have shades of their own"
    assert scene.world == sky and not bpy.data.lights and len(bpy.data.objects) == 3


def test_light_is_chosen_by_hand_and_turns_with_the_array_but_for_a_file(scene, tmp_path):
    path, sky = save_box(tmp_path / "scene.glb", (0, 0, 0), (0.5, 0.5, 0.5)), tmp_path / "sky.exr"
    image_files.write_layers(sky, {"color": np.float32([[[1, 0, 0]] * 4 + [[0, 0, 0]] * 4] * 4)})
    means, turn = {}, mathutils.Matrix.Rotation(np.pi / 2, 4, "Z")
    for chosen in ("own", "city", "city:2", "night", "even", str(sky)):
        opened, sides = open_scene(path), []
        camera = add_camera(opened, (0, -4, 0))
        for _ in range(4):
            color, said = shown(opened, tmp_path, scene=str(path), light=chosen, samples=16)
            assert said == "" and read_frame(tmp_path / "out").light == chosen
            sides.append(color.mean(0))
            camera.matrix_world = turn @ camera.matrix_world @ turn @ turn  # upside down each second time
            bpy.context.view_layer.update()
        means[chosen] = np.mean(sides, axis=0)
        assert (np.ptp(sides, axis=0).max() <= 0.35 * means[chosen].max()) == (chosen != str(sky))
    assert not means["own"].any() and means["city"].min() > means["night"].min() > 0.01 and means["even"].min() > 0.1
    assert means["city:2"] == pytest.approx(2 * means["city"], rel=0.1)
    assert means[str(sky)][0] > 0.05 and not means[str(sky)][1:].any()


@pytest.mark.parametrize(("name", "sentence"), [("gone.hdr", "does not exist"), ("text.exr", "cannot be read as an"),
                                              ("cut.exr", "cannot be read as an"), ("cut.hdr", "cannot be read as an")])
def test_a_light_file_that_cannot_be_read_is_one_sentence(scene, tmp_path, name, sentence):
    (tmp_path / "text.exr").write_text("no image")
    for path in (tmp_path / "cut.exr", tmp_path / "cut.hdr"):
        pixels = np.linspace(0, 1, 32 * 16 * 3, dtype=np.float32).reshape(16, 32, 3)
        assert oiio.ImageBuf(pixels).write(str(path))
        os.truncate(path, path.stat().st_size * 3 // 4)
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    refuses(f"{name} {sentence}", shown, scene, tmp_path, light=str(tmp_path / name))
    assert scene.world is None and not bpy.data.worlds


def test_every_frame_of_an_animation_has_the_same_light(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    with_sun(scene, 0.4)
    for number, bpy.data.lights["sun"].energy in ((1, 0.4), (10, 0.0)):
        bpy.data.lights["sun"].keyframe_insert("energy", frame=number)
    scene.frame_set(1)
    for number in (1, 10):
        job = make_request(str(tmp_path), MINI, scene="scene.glb", frame=number)
        with frame_folder.prepared(scene, job) as frame:
            assert frame.light == "own"


def test_keys_of_samples_do_not_make_the_proof_of_light_long(scene, tmp_path):
    add_camera(scene, (0, 0, 0))
    add_box(scene, (0, 5, 0), (0.5, 0.5, 0.5))
    add_lamp(scene, energy=0.001)
    scene.cycles.samples = 999
    scene.cycles.keyframe_insert("samples", frame=scene.frame_current)
    said = []
    with heard(lambda text, *_: said.append(sample_fraction(text) is not None and text)):
        assert light.is_dim(*frame_folder.light_seen(scene, make_request(str(tmp_path), MINI)))
    counts = {match[1] for text in said if text and (match := re.search(r"Sample \d+/(\d+)", text))}
    assert counts == {str(frame_folder.LIGHT_SAMPLES)} and scene.cycles.samples == 999


@pytest.fixture
def coloured(scene):
    """A box that shines in one colour."""
    add_box(scene, (0, 0, 0), (2, 2, 2), emission((0.7, 0.2, 0.05)))
    add_camera(scene)
    return scene


def color(scene, folder, **options):
    frame_folder.render_job(scene, make_request(str(folder), MINI, **{"samples": 1, "scale": 4} | options))
    return image_files.read_layers(folder / "lr_eia.exr")["color"]


def refused(scene, folder, pattern, **options):
    refuses(pattern, color, scene, folder, **options)
    assert not folder.exists()


@pytest.mark.parametrize("name", ["exposure", "gamma"])
def test_views_that_the_second_stage_does_not_know_are_refused(coloured, tmp_path, name):
    setattr(coloured.view_settings, name, float("nan"))
    refused(coloured, tmp_path / "frame", f"view {name} is nan")


@pytest.mark.skipif(not hasattr(bpy.data, "colorspace"), reason="working spaces are new in Blender 5.0")
def test_another_working_space_is_refused(coloured, tmp_path):
    bpy.ops.wm.set_working_color_space(working_space="ACEScg")
    refused(coloured, tmp_path / "frame", "working space is ACEScg")


def test_a_colour_managed_file_setting_does_not_change_the_values(coloured, tmp_path):
    expected, settings = color(coloured, tmp_path / "plain"), coloured.render.image_settings
    settings.media_type = "MULTI_LAYER_IMAGE" if hasattr(settings, "media_type") else None
    settings.file_format, settings.color_management = "OPEN_EXR_MULTILAYER", "OVERRIDE"
    settings.linear_colorspace_settings.name = "ACEScg"
    np.testing.assert_array_equal(color(coloured, tmp_path / "overridden"), expected)
    assert settings.color_management == "OVERRIDE"


def instanced(scene, kind):
    """Show the box ``item`` through an instancer that is returned, by its collection or from the corners of a mesh."""
    item = scene.objects["item"]
    if kind == "corners":
        instancer = add_mesh(scene, [(0, 0, 0)], [], mathutils.Matrix(), None)
        item.parent, instancer.instance_type = instancer, "VERTS"
        return instancer
    inner = bpy.data.collections.new("inner")
    inner.objects.link(item)
    scene.collection.objects.unlink(item)
    instancer = bpy.data.objects.new("instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", inner
    scene.collection.objects.link(instancer)
    return instancer


@pytest.mark.parametrize(("kind", "marked"), [
    (None, "item"), *((kind, marked) for kind in ("collection", "corners") for marked in ("item", "instancer"))])
def test_a_shadow_catcher_before_a_visible_world_is_refused(coloured, tmp_path, kind, marked):
    """Also in an instance."""
    coloured.world = bpy.data.worlds.new("sky")
    instancer = instanced(coloured, kind) if kind else None
    bpy.context.view_layer.update()
    color(coloured, tmp_path / "before", world_visible=True)
    {"item": bpy.data.objects["item"], "instancer": instancer}[marked].is_shadow_catcher = True
    bpy.context.view_layer.update()
    refused(coloured, tmp_path / "frame", "'item' is a shadow catcher", world_visible=True)
    color(coloured, tmp_path / "alone", world_visible=False)


def test_the_catchers_switch_of_a_light_is_none(coloured):
    """New lights have it on in Blender 5.2."""
    coloured.world = bpy.data.worlds.new("sky")
    (light := bpy.data.objects.new("Light", bpy.data.lights.new("Light", "SUN"))).is_shadow_catcher = True
    coloured.collection.objects.link(light)
    color_settings(coloured, world_visible=True)
