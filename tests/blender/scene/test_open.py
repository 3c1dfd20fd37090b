"""Files into scenes: importers, subject, light, and what is refused."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from blender_addon.array import placement
from blender_addon.render import cycles, frame_folder
from blender_addon.scene import light, open, subject
from blender_addon.scene.notices import missing_images
from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.job import Job
from lfsr_core.images import exr
from tests.support.scenes import MINI, add_box, add_camera, emission

# Box of the test files: not centred, not a cube, deeper than wide in no axis.
CENTRE, HALF = np.array((1.0, 2.0, 3.0)), np.array((0.5, 0.3, 0.4))


def save(path, scale=1.0):
    """File with one box in the format of its suffix."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_box(bpy.context.scene, tuple(CENTRE * scale), tuple(HALF * scale))
    if path.suffix == ".obj":
        bpy.ops.wm.obj_export(filepath=str(path))
    elif path.suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    else:
        bpy.ops.export_scene.gltf(filepath=str(path),
                                  export_format="GLB" if path.suffix == ".glb" else "GLTF_SEPARATE")
    return path


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj"])
def test_every_format_puts_the_box_where_it_was(tmp_path, suffix):
    scene = open.open_scene(save(tmp_path / f"scene{suffix}"))
    low, high = placement.bounds(subject.find_subject(scene))
    assert low == pytest.approx(CENTRE - HALF, abs=1e-5)
    assert high == pytest.approx(CENTRE + HALF, abs=1e-5)


def test_scene_without_light_gets_an_hdri_that_is_not_seen(tmp_path):
    path = save(tmp_path / "scene.glb")
    for world_visible in (None, True):
        scene = open.open_scene(path)
        job = Job(str(tmp_path / f"out-{world_visible}"), MINI, scene=str(path), spp=4, world_visible=world_visible)
        frame_folder.render_job(scene, job)
        layers = exr.read_layers(tmp_path / f"out-{world_visible}" / "lr_eia.exr")
        alpha = layers["color"][..., 3]
        assert layers["color"][alpha == 1][:, :3].mean() > 0.05, "the box is lit"
        assert (alpha == 0).any() and np.all(layers["color"][alpha == 0] == 0)
        assert ("environment" in layers) == bool(world_visible) == read_frame(job.output).world_visible
        assert scene.world is None and not any("city" in image.name for image in bpy.data.images)
        if world_visible:
            assert layers["environment"][alpha == 0].min() > 0 and layers["environment"][alpha == 1].max() == 0


def test_own_black_world_is_put_back(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.world = black = bpy.data.worlds.new("black")
    black.color = (0, 0, 0)
    for node in black.node_tree.nodes if black.node_tree else ():
        if node.type == "BACKGROUND":
            node.inputs["Strength"].default_value = 0.0
    with light.lit(scene) as own_light:
        assert not own_light and scene.world != black
    assert scene.world == black


def test_color_and_environment_add_up_to_blenders_own_picture(scene, tmp_path):
    """The environment layer is already weighted by what is left uncovered."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.3, 0.6, 0.9)
    job = Job(str(tmp_path), MINI, spp=64)
    with frame_folder.prepared(scene, job) as frame:
        assert frame.world_visible, "a world that Blender would show is shown"
        settings = cycles.RenderSettings(64, world_visible=True)
        with (cycles.encoded_camera(scene, frame.rays, frame.matrix_world),
              cycles.cycles_settings(scene, settings, frame.rays.size)):
            cycles.render_to(scene, tmp_path / "apart.exr")
            scene.render.film_transparent = False
            cycles.render_to(scene, tmp_path / "whole.exr")
    apart, whole = (exr.read_layers(tmp_path / f"{name}.exr") for name in ("apart", "whole"))
    partly = (apart["color"][..., 3] > 0.1) & (apart["color"][..., 3] < 0.9)
    assert partly.sum() > 10, "edges are what could go wrong"
    assert apart["color"][..., :3] + apart["environment"] == pytest.approx(whole["color"][..., :3], abs=2e-3)


@pytest.mark.parametrize(("kind", "lit"), [
    ("nothing", False), ("lamp", True), ("hidden lamp", False), ("emission", True), ("black emission", False),
    ("world", True), ("black world", False)])
def test_what_counts_as_light(scene, kind, lit):
    material = emission((0, 0, 0) if "black" in kind else (1, 1, 1)) if "emission" in kind else None
    add_box(scene, (0, 0, 0), (1, 1, 1), material)
    if "lamp" in kind:
        lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
        lamp.hide_render = "hidden" in kind
        scene.collection.objects.link(lamp)
    if "world" in kind:
        scene.world = bpy.data.worlds.new("world")
        scene.world.color = (0, 0, 0) if "black" in kind else (0.5, 0.5, 0.5)
        if scene.world.node_tree:
            background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
            background.inputs["Strength"].default_value = 0.0 if "black" in kind else 1.0
    assert light.has_light(scene) == lit


def damaged(path):
    data = path.read_bytes()
    path.write_bytes(data[:len(data) // 3])
    return path


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf"])
def test_truncated_file_is_refused(tmp_path, suffix):
    with pytest.raises(LfsrError, match=f"scene{suffix} cannot be read"):
        open.open_scene(damaged(save(tmp_path / f"scene{suffix}")))


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj"])
def test_file_of_nonsense_is_refused(tmp_path, suffix):
    path = tmp_path / f"scene{suffix}"
    path.write_bytes(b"\x00nonsense" * 100)
    with pytest.raises(LfsrError, match="cannot be read|nothing of the subject"):
        subject.find_subject(open.open_scene(path))


def test_missing_images_are_named(tmp_path):
    save(tmp_path / "scene.blend")
    material = emission((1, 1, 1))
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("lost", 4, 4)
    texture.image.source, texture.image.filepath = "FILE", str(tmp_path / "lost.png")
    assert missing_images() == [str(tmp_path / "lost.png")]


@pytest.fixture
def two(scene):
    """A box in the collection Things, another in Background."""
    for name, place in (("Things", -1), ("Background", 1)):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        item = add_box(scene, (place, 0, 0), (0.5, 0.5, 0.5), emission((1, 1, 1)))
        scene.collection.objects.unlink(item)
        collection.objects.link(item)
    return scene


def test_subject_is_what_is_not_background(two):
    things, background = (set(two.collection.children[name].objects) for name in ("Things", "Background"))
    assert subject.find_subject(two) == things == subject.find_subject(two, "Things")
    assert subject.find_subject(two, "Background") == background
    assert subject.has_background_meshes(two, things)


def test_no_visible_subject_is_refused(two):
    with pytest.raises(LfsrError, match="no collection 'Thing'.*Background, .*Things"):
        subject.find_subject(two, "Thing")
    two.collection.children["Things"].objects[0].hide_render = True
    with pytest.raises(LfsrError, match="nothing of the subject 'Scene' would be rendered"):
        subject.find_subject(two)
    two.collection.children["Things"].objects[0].hide_render = False
    two.collection.children["Things"].hide_render = True
    with pytest.raises(LfsrError, match="nothing of the subject 'Things' would be rendered"):
        subject.find_subject(two, "Things")


def test_instanced_subject_is_marked_as_foreground(two, tmp_path):
    things = two.collection.children["Things"]
    two.collection.children.unlink(things)
    empty = bpy.data.objects.new("instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", things
    two.collection.objects.link(empty)
    add_camera(two, (0, -6, 0), 1.0)
    frame_folder.render_job(two, Job(str(tmp_path), MINI, spp=1, layers=("index",)))
    index = exr.read_layers(tmp_path / "lr_eia.exr")["index"][..., 0]
    assert set(np.unique(index)) == {0, 1, 2}


def test_background_meshes_are_marked_by_index(two, tmp_path):
    add_camera(two, (0, -6, 0), 1.0)
    frame_folder.render_job(two, Job(str(tmp_path), MINI, spp=16))
    frame = read_frame(tmp_path)
    assert "index" in frame.layers, "the mask needs it as soon as there is a background mesh"
    layers = exr.read_layers(tmp_path / "lr_eia.exr")
    alpha, index = layers["color"][..., 3], layers["index"][..., 0]
    assert set(np.unique(index)) == {0, 1, 2}
    assert np.all(alpha[index > 0] > 0) and np.all(index[alpha == 0] == 0)
    left, right = np.array_split(index, 2, axis=1)
    assert (left == 1).sum() > 5 * (left == 2).sum() and (right == 2).sum() > 5 * (right == 1).sum()
    assert [item.pass_index for item in two.objects if item.type == "MESH"] == [0, 0]
