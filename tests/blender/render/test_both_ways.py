"""What Blender's own camera shows and a light field does not is named before the render.

Each feature of a scene is rendered both ways: through the middle view of a tiny display's finished light field, and
with Blender's own camera and settings. They agree, or a notice names the feature.
"""

import dataclasses
import functools

import bpy
import numpy as np
import pytest

from blender_addon import compat
from blender_addon.render.frame_folder import render_job
from blender_addon.scene.contents import left_out
from blender_addon.scene.files import camera_notices
from lfsr_core.base.messages import LfsrError
from lfsr_core.exports.light_field import read_views
from lfsr_core.images.image_files import read_png
from lfsr_core.reconstruct.second_stage import finish_frame
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_camera, add_world, fresh_scene

LENSES, SAMPLES = (32, 24), 48
TINY = dataclasses.replace(MINI, name="tiny", lenses=LENSES, views=(3, 3), panel_pixels=(96, 72))
AGREE = 4.0  # of 255, mean absolute difference of two renders of one scene, with their noise


def material(color):
    made = bpy.data.materials.new("material")
    compat.use_nodes(made)
    made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1)
    return made


def shown(scene):
    """The box in front, of which features change something."""
    return scene.objects["item"]


def connect(scene, kind, output):
    """Lead an output of a new node into the material of the box."""
    tree = shown(scene).data.materials[0].node_tree
    tree.links.new(tree.nodes.new(kind).outputs[output], tree.nodes["Principled BSDF"].inputs["Base Color"])


@pytest.fixture
def base():
    scene = fresh_scene()
    add_box(scene, (0, 0, -1.1), (6, 6, 0.1), material((0.5, 0.5, 0.5)))
    add_box(scene, (1.2, 2, -0.4), (0.4, 0.4, 0.6), material((0.2, 0.3, 0.8))).name = "behind"
    add_box(scene, (-0.5, 0, -0.4), (0.6, 0.6, 0.6), material((0.8, 0.3, 0.2)))
    scene.objects["item"].name, scene.objects["item.001"].name = "floor", "item"
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler, sun.visible_camera = 3, (0.6, 0.3, 0), False
    scene.collection.objects.link(sun)
    add_world(scene, 0.5)
    scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = "MANUAL", 64  # or seconds are spent
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.4, 0.6, 1)
    add_camera(scene, (0, -6, 0.4), 0.7)
    scene.render.resolution_x, scene.render.resolution_y = LENSES
    scene.render.image_settings.file_format, scene.render.film_transparent = "PNG", False
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling, cycles.device = SAMPLES, False, False, "CPU"
    return scene


def own_view(scene, folder):
    scene.render.filepath = str(folder / "own.png")
    bpy.ops.render.render(write_still=True)
    image = read_png(folder / "own.png").astype(float)
    image = image[..., :3] * image[..., 3:] / 255 if image.shape[2] == 4 else image
    if image.shape[:2] == LENSES[::-1]:
        return image
    rows, columns = (np.arange(size) * image.shape[axis] // size for axis, size in enumerate(LENSES[::-1]))
    return image[rows][:, columns]


def difference(scene, folder):
    """Mean absolute difference of the view in the middle and Blender's own picture."""
    render_job(scene, make_request(str(folder / "frame"), TINY, scale=3, samples=SAMPLES, view_aperture=0))
    finish_frame(folder / "frame", "bilinear")
    return np.abs(read_views(folder / "frame")[1, 1] - own_view(scene, folder)).mean()


def glare(scene):
    made = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
    made.location, made.data.energy, made.data.shadow_soft_size = (-1, -2, 2), 3e4, 0.1
    scene.collection.objects.link(made)


def put(owner=lambda scene: scene, **values):
    """Set properties of the scene, or of what ``owner`` takes from it; __ stands for a dot."""
    def use(scene):
        for path, value in values.items():
            *owners, name = path.split("__")
            setattr(functools.reduce(getattr, owners, owner(scene)), name, value() if callable(value) else value)
    return use


def both(*steps):
    return lambda scene: [step(scene) for step in steps]


def strength(scene):
    return scene.world.node_tree.nodes["Background"].inputs["Strength"]


def layer(scene):
    return scene.view_layers[0]


def moving(scene):
    item = shown(scene)
    for frame, place in ((0, -1), (2, 1)):
        item.location.x = place
        item.keyframe_insert("location", frame=frame)
    scene.frame_set(1)


def sheared(scene):
    parent = bpy.data.objects.new("parent", None)
    parent.scale = (1, 1, 2.5)
    scene.collection.objects.link(parent)
    scene.camera.parent = parent
    scene.camera.rotation_euler.x -= 0.3
    scene.camera.rotation_euler.z += 0.3


def world_coordinates(output):
    def use(scene):
        tree = scene.world.node_tree
        light = tree.nodes.new("ShaderNodeVectorMath")
        light.operation = "ABSOLUTE"
        tree.links.new(light.outputs["Vector"], tree.nodes["Background"].inputs["Color"])
        tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs[output], light.inputs[0])
    return use


def world_volume(scene):
    tree = scene.world.node_tree
    volume = tree.nodes.new("ShaderNodeVolumeScatter")
    volume.inputs["Density"].default_value = 0.05
    tree.links.new(volume.outputs[0], tree.nodes["World Output"].inputs["Volume"])


def marker(scene):
    other = scene.camera.copy()
    other.location.x = 2
    scene.collection.objects.link(other)
    scene.timeline_markers.new("cut", frame=1).camera = other
    scene.frame_set(1)


OUTPUTS = ("Generated", "Normal", "Camera", "Window", "Reflection", "Object", "UV")
FEATURES = {
    "nothing": put(),
    # The world
    "world strength": put(strength, default_value=3), "negative world": put(strength, default_value=-1),
    "hidden world": put(render__film_transparent=True), "world volume": world_volume,
    "world invisible": put(world__cycles_visibility__camera=False),
    **{f"world {output}": world_coordinates(output) for output in OUTPUTS},
    # Materials that can tell which camera sees them, or show what is behind them
    "transparent": put(lambda scene: shown(scene).data.materials[0].node_tree.nodes["Principled BSDF"].inputs["Alpha"],
                       default_value=0.4),
    **{f"material {output}": lambda scene, output=output: connect(scene, "ShaderNodeTexCoord", output)
       for output in OUTPUTS},
    "camera data": lambda scene: connect(scene, "ShaderNodeCameraData", "View Distance"),
    "light path": lambda scene: connect(scene, "ShaderNodeLightPath", "Ray Depth"),
    # Objects
    "shadow catcher": both(put(lambda scene: scene.objects["floor"], is_shadow_catcher=True),
                           put(render__film_transparent=True)),
    "holdout": put(shown, is_holdout=True), "unseen": put(shown, visible_camera=False),
    "grease pencil": lambda _: bpy.ops.object.grease_pencil_add(type="MONKEY", location=(0.8, -1, 0),
                                                                rotation=(1.57, 0, 0)),
    # The camera
    "vertical fit": put(camera__data__sensor_fit="VERTICAL"),
    "clip": put(camera__data__clip_end=6.5), "clip start": put(camera__data__clip_start=5.8),
    "orthographic": put(camera__data__type="ORTHO"), "panorama": put(camera__data__type="PANO"),
    "sheared camera": sheared, "scaled camera": put(camera__scale=(2, 2, 2)),
    "marker": marker,
    # Render settings
    "motion": moving, "percentage": put(render__resolution_percentage=50),
    "filter width": put(cycles__filter_width=8.0), "bright": glare,
    "bounces": put(cycles__max_bounces=0),
    "film exposure": put(cycles__film_exposure=3.0), "less exposure": put(cycles__film_exposure=0.3),
    "exposure": put(view_settings__exposure=1.0), "gamma": put(view_settings__gamma=2.0),
    "view": put(view_settings__view_transform="Standard"),
    "fast light": put(cycles__use_fast_gi=True), "camera cull": put(cycles__use_camera_cull=True),
    "freestyle": put(render__use_freestyle=True), "layer samples": put(layer, samples=1)}


# What is named here; other notices are tested in check/test_problems.py.
NAMED = {"negative world", "world Window", "material Window", "grease pencil", "sheared camera", "freestyle",
         "orthographic"}


@pytest.mark.parametrize("name", FEATURES)
def test_a_feature_agrees_or_is_named(base, tmp_path, name):
    FEATURES[name](base)
    base.view_layers[0].update()
    named = [notice.code for notice in (*left_out(base), *camera_notices(base, None, False))]
    assert bool(named) == (name in NAMED)
    try:
        assert named or difference(base, tmp_path) < AGREE
    except LfsrError as error:
        assert "camera" in str(error)  # refused
