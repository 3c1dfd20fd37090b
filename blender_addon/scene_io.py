"""Scenes in: opening files, finding the subject, and light for scenes that bring none."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.render_job import check_scene

from . import compat

BACKGROUND_COLLECTION = "Background"
DEFAULT_LIGHT = "city.exr"   # neutral, from all sides: glass and skin both read well
GEOMETRY = {"MESH", "CURVE", "SURFACE", "FONT", "META", "VOLUME", "CURVES", "POINTCLOUD"}


def open_scene(path: str | Path) -> bpy.types.Scene:
    """Open a .blend, or import .glb, .gltf or .obj into an empty file; LfsrError if that fails."""
    path = check_scene(path)
    try:
        _readers()[Path(path).suffix.lower()](path)
    except (RuntimeError, ValueError, KeyError, OSError) as error:
        reason = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
        raise LfsrError(f"scene {path} cannot be read ({reason}): check that the file is whole") from None
    return bpy.context.scene


def choose_scene(name: str) -> bpy.types.Scene:
    """Make the scene ``name`` of the open file the current one; LfsrError if there is none."""
    scene = bpy.data.scenes.get(name)
    if scene is None:
        raise LfsrError(f"the file has no scene {name!r}: choose one of {', '.join(bpy.data.scenes.keys())}")
    # What Blender evaluates is the window's scene, and not always the one that was open when the file was saved.
    bpy.context.window.scene = scene
    return scene


def _readers() -> dict[str, Callable[[str], None]]:
    return {".blend": _open_blend, ".glb": _import_gltf, ".gltf": _import_gltf, ".obj": _import_obj}


def _open_blend(path: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)


def _import_gltf(path: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)


def _import_obj(path: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.obj_import(filepath=path)


def missing_images() -> list[str]:
    """Paths of image files that the scene names and that are not there."""
    images = (image for image in bpy.data.images if image.source == "FILE" and not image.packed_file)
    paths = (Path(bpy.path.abspath(image.filepath, library=image.library)) for image in images if image.filepath)
    return sorted({str(path) for path in paths if not path.is_file()})


def find_subject(scene: bpy.types.Scene, name: str | None = None) -> set[bpy.types.Object]:
    """Objects of the collection ``name``; without it all that are not in a collection called Background.

    LfsrError if there is no such collection or nothing of it would be rendered.
    """
    if name:
        collections = {c.name: c for c in (scene.collection, *scene.collection.children_recursive)}
        if name not in collections:
            raise LfsrError(f"the scene has no collection {name!r} for the subject: choose one of "
                            f"{', '.join(sorted(collections))}")
        chosen = set(collections[name].all_objects)
    else:
        background = bpy.data.collections.get(BACKGROUND_COLLECTION)
        chosen = set(scene.objects) - (set(background.all_objects) if background else set())
    subject = chosen | {child for item in chosen for child in _instanced(item)}
    if not any(item.type in GEOMETRY and _rendered(scene, item) for item in subject):
        raise LfsrError(f"nothing of the subject {name or scene.name!r} would be rendered: "
                        "make its objects visible in renders or choose another collection")
    return subject


def has_background_meshes(scene: bpy.types.Scene, subject: set[bpy.types.Object]) -> bool:
    """True if something that is not the subject would be rendered behind or beside it."""
    return any(item.type in GEOMETRY and item not in subject and _rendered(scene, item) for item in scene.objects)


def _instanced(item: bpy.types.Object) -> set[bpy.types.Object]:
    """Objects that a collection instance shows, which live outside the scene's own collections."""
    if item.instance_type != "COLLECTION" or item.instance_collection is None:
        return set()
    inside = set(item.instance_collection.all_objects)
    return inside | {child for other in inside for child in _instanced(other)}


def _rendered(scene: bpy.types.Scene, item: bpy.types.Object) -> bool:
    owners = [c for c in (scene.collection, *scene.collection.children_recursive) if item.name in c.objects]
    return not item.hide_render and (not owners or any(not c.hide_render for c in owners))


def has_light(scene: bpy.types.Scene) -> bool:
    """True if anything in the scene shines: a light, a world, or an emissive material in use."""
    if any(item.type == "LIGHT" and not item.hide_render and item.data.energy for item in scene.objects):
        return True
    if scene.world is not None and _shines(scene.world.node_tree, scene.world.color):
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


@contextmanager
def lit(scene: bpy.types.Scene, name: str = DEFAULT_LIGHT) -> Iterator[bool]:
    """Inside the block ``scene`` has light, if need be from Blender's own HDRI; True if it is the scene's own."""
    if has_light(scene):
        yield True
        return
    before, world = scene.world, add_light(scene, name)
    try:
        yield False
    finally:
        scene.world = before
        images = [node.image for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT"]
        bpy.data.worlds.remove(world)
        for image in images:
            if not image.users:
                bpy.data.images.remove(image)


def add_light(scene: bpy.types.Scene, name: str = DEFAULT_LIGHT) -> bpy.types.World:
    """Light the scene with one of the world HDRIs that ship inside Blender (CC0)."""
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
