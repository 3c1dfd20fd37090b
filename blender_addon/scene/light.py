"""The light of a scene: the panel's menu, whether there is any, and light for scenes that have none."""

import math
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import AUTO, EVEN, OWN, WORLD_IMAGES, check_light, is_light_file, light_parts

from .. import compat
from .array import rig
from .contents import materials, nodes_of, rendered, with_copied

DEFAULT_LIGHT = "city"  # neutral, from all sides: suits glass as well as skin
# Brightness below which a white surface is almost in the dark. The world of a new file, 0.05, lights less.
DIM = 0.08
BLACK, MORE, GLOWS = 0.05, 2.0, 0.5  # brightest 5 %: below BLACK it takes MORE times the light, above GLOWS none
LEAST_ALBEDO = 0.1  # darker surfaces count as if they reflected this much: what is black needs more light to be seen
SKY, WHITE = 0.5, 0.6  # radiance of a sky that is an image or a texture, of a white floor under a shipped image
CERTAIN_SUN, CERTAIN_WORLD = 0.5, 0.1   # W/m² and radiance that show a white surface well above that
# Lamps of even light: direction from which they shine, in degrees around Z from the front and above the ground, W/m².
EVEN_LAMPS = ((-40, 50, 2.0), (80, 25, 1.0), (200, 35, 1.0), (0, -80, 0.5))
AUTO_LIGHT, OWN_LIGHT, FILE_LIGHT = "AUTO", "OWN", "FILE"
SCENE_LIGHTS = (AUTO_LIGHT, OWN_LIGHT)  # in which the scene's own light counts
# Menu entry, in Blender's capitals: name in a request.
NAMES = {AUTO_LIGHT: AUTO, OWN_LIGHT: OWN, EVEN.upper(): EVEN, **{name.upper(): name for name in WORLD_IMAGES}}


def light_items() -> list[tuple[str, str, str, int]]:
    """Enum items; each has a number of its own, so that new lights do not change saved scenes."""
    texts = {AUTO_LIGHT: ("Auto", "The scene's own light, or one of Blender's world images if it has none"),
             OWN_LIGHT: ("Scene", "The scene's own light, even if it has none"),
             EVEN.upper(): ("Even", "Light from all sides without shadows, also inside a closed room")}
    texts |= {name.upper(): (name.title(), f"Blender's world image {name!r}; lamps of the scene stay")
              for name in WORLD_IMAGES}
    texts[FILE_LIGHT] = "From File…", "A world image of yours (.hdr or .exr); lamps of the scene stay"
    return [(name, *text, zlib.crc32(name.encode()) & 0x7FFFFFFF) for name, text in texts.items()]


def has_light(scene: bpy.types.Scene) -> bool:
    """Return True if anything in the scene emits light: a lamp, a world, or a material in use."""
    return world_radiance(scene.world) > 0 or has_emission(scene) or any(
        item.type == "LIGHT" and item.data.energy for item in with_copied(rendered(scene)))


def _shines(tree: bpy.types.NodeTree | None, plain: tuple[float, ...]) -> bool:
    return any(plain[:3]) if tree is None else any(map(_emits, nodes_of(tree)))


def _emits(node: bpy.types.Node) -> bool:
    if node.type in ("OUTPUT_MATERIAL", "OUTPUT_WORLD"):  # a color without a shader shines
        return any(link.from_socket.type != "SHADER" for link in node.inputs["Surface"].links)
    prefix = {"BACKGROUND": "", "EMISSION": "", "BSDF_PRINCIPLED": "Emission ", "PRINCIPLED_VOLUME": "Emission "}
    if node.type not in prefix or not any(output.is_linked for output in node.outputs):
        return False
    color, strength = (node.inputs[prefix[node.type] + name] for name in ("Color", "Strength"))
    return (color.is_linked or any(color.default_value[:3])) and (strength.is_linked or strength.default_value > 0)


def is_certain(scene: bpy.types.Scene) -> bool:
    """Return True if light certainly arrives at the scene's exposure: from a world of one colour or from a sun."""
    factor = 2.0**scene.view_settings.exposure
    suns = [item.data.energy for item in rendered(scene)
            if item.type == "LIGHT" and item.data.type == "SUN" and any(item.data.color)]
    return max(suns, default=0.0) * factor >= CERTAIN_SUN or _plain_world(scene.world) * factor >= CERTAIN_WORLD


def is_dim(light: Array, radiance: Array, is_composed: bool = False) -> bool:
    """Return True if most of a picture is hardly lit, by what white surfaces would send and by what it sends."""
    bright = float(np.percentile(radiance, 95)) if light.size else 0.0
    times = MORE if bright < BLACK else 0.0 if is_composed and bright > GLOWS else 1.0  # an artist's lamps at night
    return bool(light.size and np.median(light) < DIM * times)


def has_emission(scene: bpy.types.Scene) -> bool:
    """Return True if a material in use shines."""
    return any(_shines(material.node_tree, (0, 0, 0)) for material in materials(scene))


def world_radiance(world: bpy.types.World | None, unknown: float = SKY) -> float:
    """Return about how bright the sky of a world is: ``unknown`` for an image or a texture."""
    return _plain_world(world) or (unknown if world is not None and _shines(world.node_tree, world.color) else 0.0)


def _plain_world(world: bpy.types.World | None) -> float:
    """Radiance of a world of one colour, 0 for any other world; frames and unused nodes do not count."""
    if world is None or world.node_tree is None:
        return max(world.color) if world is not None else 0.0
    if any(node.type != "BACKGROUND" and any(out.is_linked for out in node.outputs) for node in world.node_tree.nodes):
        return 0.0
    return max((max(node.inputs["Color"].default_value[:3]) * node.inputs["Strength"].default_value
                for node in world.node_tree.nodes if _emits(node)), default=0.0)


@contextmanager
def lit(scene: bpy.types.Scene, light: str) -> Iterator[None]:
    """Light ``scene`` with what ``illuminate`` adds inside the block."""
    before, added = scene.world, illuminate(scene, light)
    try:
        with compat.overridden(scene.cycles, {"diffuse_bounces": 0} if light == EVEN else {}):
            yield
    finally:
        scene.world = before
        bpy.data.batch_remove(added)


def illuminate(scene: bpy.types.Scene, light: str, seen: bpy.types.Scene | None = None) -> list[bpy.types.ID]:
    """Light ``scene``, and return the new data: OWN adds nothing, EVEN lamps, anything else a world image.

    Lamps and Blender's own images turn with the array, else the camera, of ``seen``, else of ``scene``: from behind the
    viewer or the subject, a sun shows no shapes. Even light goes with no diffuse bounces: they light white rooms alike.
    """
    if light == OWN:
        return []
    viewer, turn = rig.find(seen or scene) or (seen or scene).camera, 0.0
    if viewer is not None:  # its heading, also upside down, or above what it looks at
        up, back = (viewer.matrix_world.col[axis] for axis in (1, 2))
        turn = math.atan2(back.x - back.z * up.x, back.z * up.y - back.y)
    if light != EVEN:
        world = add_light(scene, light, 0.0 if is_light_file(light) else turn)
        return [world, *(node.image for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")]
    lamps = [bpy.data.objects.new("LFSR light", bpy.data.lights.new("LFSR light", "SUN")) for _ in EVEN_LAMPS]
    for lamp, (around, above, strength) in zip(lamps, EVEN_LAMPS, strict=True):
        lamp.rotation_euler = math.radians(90 - above), 0, math.radians(around) + turn
        lamp.data.energy, lamp.data.use_shadow, lamp.visible_camera = strength, False, False
        scene.collection.objects.link(lamp)
    return [data for lamp in lamps for data in (lamp, lamp.data)]


def add_light(scene: bpy.types.Scene, light: str = DEFAULT_LIGHT, turn: float = 0.0) -> bpy.types.World:
    """Light the scene with a world image, turned around Z by radians: a file's, or one that ships with Blender (CC0).

    A shipped image is dimmed until a white floor has the radiance WHITE: brighter, shapes and shadows hardly show.
    LfsrError where it is missing, or cannot be read to its end, because Blender might crash.
    """
    light, strength = light_parts(light)
    unreadable = LfsrError(f"light {light} cannot be read as an image: choose another file")
    if is_light_file(light):
        from lfsr_core.images.image_files import check_complete  # needs OpenImageIO, which Blender's panel does without

        check_light(light)
        try:
            check_complete(path := Path(light))
        except (LfsrError, MemoryError):
            raise unreadable from None
    else:
        path = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world", f"{light}.exr")
        if not path.is_file():
            raise LfsrError(f"this Blender has no world image {light!r}: choose another light, or give a .hdr or .exr "
                            "file")
    image = bpy.data.images.load(str(path))
    if not all(image.size):
        bpy.data.images.remove(image)
        raise unreadable
    world = bpy.data.worlds.new("LFSR light")
    compat.use_nodes(world)
    nodes = world.node_tree.nodes
    texture, shader = nodes.new("ShaderNodeTexEnvironment"), next(node for node in nodes if node.type == "BACKGROUND")
    texture.image, texture.texture_mapping.rotation[2] = image, -turn
    if not is_light_file(light):
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        rows = pixels.reshape(image.size[1], image.size[0], -1)[..., :3].max(-1).mean(1)  # from the ground upwards
        elevation = ((np.arange(len(rows)) + 0.5) / len(rows) - 0.5) * math.pi
        floor = float(rows @ np.maximum(np.sin(2 * elevation), 0) * math.pi / len(rows))  # radiance of a white one
        shader.inputs["Strength"].default_value = strength * WHITE / max(WHITE, floor)
    world.node_tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    scene.world = world
    return world
