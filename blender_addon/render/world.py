"""A visible world apart from the subject: rendered alone, once, while the light field says how much of it shows.

The world behind everything depends on a ray's direction only. So one small picture of it holds what every ray at
full resolution sees of it (``lfsr_core.optics.world_view``), and the low-resolution render keeps, in its layer
``environment``, the share of it that shows: camera rays see a white world there. Light, mirrors and glass see the
scene's own.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.optics.world_view import WorldImage

from .. import compat
from ..array.spaces import Matrix, to_blender
from .cycles import RenderSettings, cycles_settings, render_to
from .overrides import overridden

NAME = "LFSR World"
# Of a pixel of the picture, 36 of which a light field's pixel sees; more change it by 4e-4 (rms of sRGB values).
SAMPLES = 4
SENSOR_MM = 36.0
_UNSUITED_COORDINATES = {"Window", "Camera"}


def reason_against(scene: bpy.types.Scene) -> str:
    """Why the scene's visible world cannot be rendered apart; empty where it can."""
    nodes = list(_nodes(scene.world.node_tree)) if scene.world.node_tree else []
    outputs = [node for node in nodes if node.bl_idname == "ShaderNodeOutputWorld"]
    if any(node.inputs["Volume"].is_linked for node in outputs):
        return "the world has a volume"
    if any(node.bl_idname == "ShaderNodeTexCoord" and node.outputs[name].is_linked
           for node in nodes for name in _UNSUITED_COORDINATES):
        return "the world's look depends on the camera's window"
    if any(item.type == "LIGHT" and item.data.type == "SUN" and item.visible_camera and not item.hide_render
           for item in scene.objects):
        return "a sun lamp is visible to the camera"
    return ""


def _nodes(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Nodes of a tree and of the groups in it."""
    for node in tree.nodes:
        yield node
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            yield from _nodes(node.node_tree)


@contextmanager
def white_to_camera(scene: bpy.types.Scene) -> Iterator[None]:
    """Inside the block rays from the camera see a world of radiance 1, all others the scene's own."""
    made = scene.world.copy()
    try:
        _show_white(made)
        with overridden(scene, {"world": made}):
            yield
    finally:
        bpy.data.worlds.remove(made)


def _show_white(world: bpy.types.World) -> None:
    plain = world.node_tree is None
    compat.use_nodes(world)
    tree = world.node_tree
    output = tree.get_output_node("CYCLES") or tree.nodes.new("ShaderNodeOutputWorld")
    seen, mix, white = (tree.nodes.new(kind) for kind in (
        "ShaderNodeLightPath", "ShaderNodeMixShader", "ShaderNodeBackground"))
    white.inputs["Color"].default_value, white.inputs["Strength"].default_value = (1, 1, 1, 1), 1.0
    links = output.inputs["Surface"].links
    if plain:
        own = tree.nodes.new("ShaderNodeBackground")
        own.inputs["Color"].default_value = (*world.color, 1)
        tree.links.new(own.outputs[0], mix.inputs[1])
    elif links:
        tree.links.new(links[0].from_socket, mix.inputs[1])
    tree.links.new(seen.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(white.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])


def render_world(scene: bpy.types.Scene, picture: WorldImage, matrix_world: Matrix, settings: RenderSettings,
                 path: Path) -> float:
    """Render the world of ``scene`` alone into ``path``, as ``picture`` says, seen from the array; seconds."""
    alone = bpy.data.scenes.new(NAME)
    camera = _camera(alone, picture, matrix_world)
    try:
        alone.world = scene.world
        alone.frame_current, alone.frame_subframe = scene.frame_current, scene.frame_subframe
        # Nothing is lit, so that a map of where the world is bright would be made for nothing.
        unlit = {"sampling_method": "NONE"} if scene.world.is_editable else {}
        with (overridden(scene.world.cycles, unlit), cycles_settings(alone, settings, picture.size),
              overridden(alone.render, _seen(picture))):
            return render_to(alone, path)
    finally:
        data = camera.data
        bpy.data.scenes.remove(alone)
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)


def _seen(picture: WorldImage) -> dict[str, object]:
    return {"film_transparent": False, "use_persistent_data": False, "pixel_aspect_x": max(1.0, 1 / picture.aspect),
            "pixel_aspect_y": max(1.0, picture.aspect)}


def _camera(scene: bpy.types.Scene, picture: WorldImage, matrix_world: Matrix) -> bpy.types.Object:
    """Ordinary camera of the picture's directions."""
    data = bpy.data.cameras.new(NAME)
    camera = bpy.data.objects.new(NAME, data)
    camera.matrix_world = to_blender(matrix_world)
    data.type, data.sensor_fit, data.sensor_width = "PERSP", "HORIZONTAL", SENSOR_MM
    data.lens = SENSOR_MM / 2 / picture.reach[0]
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera
