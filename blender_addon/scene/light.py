"""Find out whether a scene has light, and light scenes that have none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError

from .. import compat

DEFAULT_LIGHT = "city.exr"   # neutral, from all sides: suits glass as well as skin
CERTAIN_SUN, CERTAIN_WORLD = 0.5, 0.05   # W/m² and radiance that show a white surface well above black


def has_light(scene: bpy.types.Scene) -> bool:
    """Return True if anything in the scene emits light: a lamp, a world, or a material in use."""
    if is_meant(scene):
        return True
    materials = {slot.material for item in scene.objects if not item.hide_render for slot in item.material_slots}
    return any(material is not None and _shines(material.node_tree, (0, 0, 0)) for material in materials)


def _shines(tree: bpy.types.NodeTree | None, plain: tuple[float, ...]) -> bool:
    if tree is None:
        return any(plain[:3])
    return any(_emits(node) for node in tree.nodes if not node.mute)


def _emits(node: bpy.types.Node) -> bool:
    color, strength = {"BACKGROUND": ("Color", "Strength"), "EMISSION": ("Color", "Strength"),
                       "BSDF_PRINCIPLED": ("Emission Color", "Emission Strength")}.get(node.type, (None, None))
    if color is None or not any(output.is_linked for output in node.outputs):
        return False
    color, strength = node.inputs[color], node.inputs[strength]
    lit = color.is_linked or any(color.default_value[:3])
    return lit and (strength.is_linked or strength.default_value > 0)


def is_certain(scene: bpy.types.Scene) -> bool:
    """Return True if light certainly arrives at the scene's exposure: from a world of one colour or from a sun."""
    factor = 2.0**scene.view_settings.exposure
    suns = [item.data.energy for item in scene.objects if item.type == "LIGHT" and item.data.type == "SUN"
            and not item.hide_render and any(item.data.color)]
    return max(suns, default=0.0) * factor >= CERTAIN_SUN or _plain_world(scene.world) * factor >= CERTAIN_WORLD


def is_meant(scene: bpy.types.Scene) -> bool:
    """Return True if somebody has lit the scene, with a lamp or a world; emissive materials do not count."""
    lamps = any(item.type == "LIGHT" and not item.hide_render and item.data.energy for item in scene.objects)
    return lamps or (scene.world is not None and _shines(scene.world.node_tree, scene.world.color))


def _plain_world(world: bpy.types.World | None) -> float:
    """Radiance of a world of one colour, 0 for any other world."""
    if world is None:
        return 0.0
    if world.node_tree is None:
        return max(world.color)
    if any(node.type not in {"BACKGROUND", "OUTPUT_WORLD"} for node in world.node_tree.nodes):
        return 0.0
    return max((max(node.inputs["Color"].default_value[:3]) * node.inputs["Strength"].default_value
                for node in world.node_tree.nodes if _emits(node)), default=0.0)


@contextmanager
def lit(scene: bpy.types.Scene, is_own: bool) -> Iterator[None]:
    """Light ``scene`` inside the block with a world image, unless ``is_own``: it has light of its own."""
    if is_own:
        yield
        return
    before, world = scene.world, add_light(scene)
    try:
        yield
    finally:
        scene.world = before
        images = [node.image for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT"]
        bpy.data.worlds.remove(world)
        for image in images:
            if not image.users:
                bpy.data.images.remove(image)


def add_light(scene: bpy.types.Scene, name: str = DEFAULT_LIGHT) -> bpy.types.World:
    """Light the scene with one of the world images that ship with Blender (CC0)."""
    path = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world", name)
    if not path.is_file():
        raise LfsrError(f"the scene has no light and this Blender has no {path.name} to light it with: add a light")
    world = bpy.data.worlds.new("LFSR light")
    compat.use_nodes(world)
    nodes = world.node_tree.nodes
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(path), check_existing=True)
    background = next(node for node in nodes if node.type == "BACKGROUND")
    world.node_tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    scene.world = world
    return world
