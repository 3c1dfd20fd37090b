"""Light for scenes that bring none, and what counts as light."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from blender_addon.render import frame_folder
from blender_addon.scene import light
from blender_addon.scene.open import open_scene
from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.job import Job
from lfsr_core.images import exr
from tests.support.scenes import MINI, add_box, emission, save_box


def test_scene_without_light_gets_an_hdri_that_is_not_seen(tmp_path):
    path = save_box(tmp_path / "scene.glb", (1.0, 2.0, 3.0), (0.5, 0.3, 0.4))
    for world_visible in (None, True):
        scene = open_scene(path)
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
    with light.lit(scene, is_own=light.has_light(scene)):
        assert scene.world != black
    assert scene.world == black


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


def with_sun(scene, strength):
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = strength, (1.0, 0, 0.3)
    scene.collection.objects.link(sun)


def brightness(stage, tmp_path, **options):
    """Brightest pixel of a render, and what was said."""
    said = []
    frame_folder.render_job(stage, Job(str(tmp_path / "out"), MINI, spp=1, **options), warn=said.append)
    color = exr.read_layers(tmp_path / "out" / "lr_eia.exr")["color"]
    return color[..., :3].max(), " ".join(said)


def test_glow_that_lights_nothing_counts_as_no_light(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    add_box(scene, (0, 40, 0), (0.01, 0.01, 0.01), emission((0.01, 0.01, 0.01)))
    scene.collection.children.link(bpy.data.collections.new("box"))
    scene.collection.children["box"].objects.link(scene.objects["item"])
    assert light.has_light(scene)
    brightest, said = brightness(scene, tmp_path, subject="box")
    assert brightest > 0.05 and "Almost no light reaches" in said and "lit with" in said


@pytest.mark.parametrize(("file", "lit"), [("", False), ("sun.glb", True)])
def test_sun_of_next_to_nothing_is_left_to_the_artist_and_replaced_in_files_from_elsewhere(scene, tmp_path, file, lit):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    with_sun(scene, 3 / 683)
    brightest, said = brightness(scene, tmp_path, scene=file)
    assert "Almost no light reaches" in said
    assert brightest > 0.05 if lit else brightest < 0.01


def test_lamp_that_arrives_is_left_alone(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
    lamp.data.energy, lamp.location = 100, (0, -3, 1)
    scene.collection.objects.link(lamp)
    assert not light.is_certain(scene)
    brightest, said = brightness(scene, tmp_path)
    assert brightest > 0.05 and not said and scene.world is None
