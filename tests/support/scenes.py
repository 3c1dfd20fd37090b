"""Small scenes for the tests that need Blender, and what they share."""

import dataclasses
import itertools
from collections.abc import Callable
from pathlib import Path

import bpy
import mathutils
import numpy as np

from blender_addon import compat
from blender_addon.render import cycles
from blender_addon.scene.array import rig
from lfsr_core.images import image_files
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.rays import CameraArray, RayLayout

ROOT = Path(__file__).resolve().parents[2]
MINI = load_display("mini")
FLAT = dataclasses.replace(MINI, lenses=(16, 96), views=(8, 1))  # no vertical parallax, and views of oblong pixels
TINY = DisplayProfile("tiny", (64, 48), (59.04, 44.28), (8, 6), (8, 8), 500.0, 40.0)
ARRAY = CameraArray.for_display(MINI, 2.0)
# Turned and moved, so that no axis and no origin can be mistaken for another.
TURNED = mathutils.Matrix.Translation((0.3, -4.0, 0.7)) @ mathutils.Euler((1.3, 0.2, -0.4)).to_matrix().to_4x4()
POSITION_OFFSET = 20.0   # makes every coordinate of the small scenes positive, as light is


def fresh_scene() -> bpy.types.Scene:
    """An empty scene in an empty file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.engine = "CYCLES"
    return bpy.context.scene


def front() -> tuple[tuple[float, ...], ...]:
    """Array at the distance of ARRAY in front of the origin, looking along +Y with Z up."""
    place = mathutils.Matrix.Translation((0, -ARRAY.distance, 0))
    return rig.from_blender(place @ mathutils.Matrix.Rotation(np.pi / 2, 4, "X"))


def add_plane(scene: bpy.types.Scene, matrix: mathutils.Matrix, material: bpy.types.Material,
              size: float = 50.0) -> bpy.types.Object:
    """Square in the XY plane of ``matrix``, ``size`` to each side."""
    corners = [(-size, -size, 0), (size, -size, 0), (size, size, 0), (-size, size, 0)]
    return add_mesh(scene, corners, [(0, 1, 2, 3)], matrix, material)


def add_box(scene: bpy.types.Scene, centre: tuple[float, ...], half: tuple[float, ...],
            material: bpy.types.Material | None = None) -> bpy.types.Object:
    """Box around ``centre``."""
    corners = [tuple(c + h * s for c, h, s in zip(centre, half, sign, strict=True))
               for sign in ((x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1))]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return add_mesh(scene, corners, faces, mathutils.Matrix(), material)


def add_mesh(scene: bpy.types.Scene, corners: list, faces: list, matrix: mathutils.Matrix,
             material: bpy.types.Material | None) -> bpy.types.Object:
    """Object with a mesh of its own."""
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(corners, [], faces)
    if material:
        mesh.materials.append(material)
    item = bpy.data.objects.new("item", mesh)
    item.matrix_world = matrix
    scene.collection.objects.link(item)
    return item


def add_camera(scene: bpy.types.Scene, place: tuple[float, ...] = (1.0, -5.0, 3.0),
               angle: float = 0.6) -> bpy.types.Object:
    """The scene's camera, at ``place``, looking along +Y with Z up."""
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.angle = angle
    camera.matrix_world = mathutils.Matrix.Translation(place) @ mathutils.Matrix.Rotation(np.pi / 2, 4, "X")
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.context.view_layer.update()
    return camera


def add_lamp(scene: bpy.types.Scene, energy: float = 200.0, size: float = 2.0, place: tuple[float, ...] = (1, -4, 2),
             turn: tuple[float, ...] = (1.1, 0, 0.2)) -> bpy.types.Object:
    """Square lamp before the display plane, a little above it."""
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "AREA"))
    lamp.data.energy, lamp.data.size, lamp.location, lamp.rotation_euler = energy, size, place, turn
    scene.collection.objects.link(lamp)
    return lamp


def add_world(scene: bpy.types.Scene, color: float, strength: float = 1.0) -> bpy.types.World:
    """The scene's world, grey of this brightness."""
    world = scene.world = bpy.data.worlds.new("world")
    compat.use_nodes(world)
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (color, color, color, 1)
    background.inputs["Strength"].default_value = strength
    return world


def emission(color: tuple[float, float, float]) -> bpy.types.Material:
    """Material that shines in ``color`` and reflects nothing."""
    return _emission(lambda tree, shader: setattr(shader.inputs["Color"], "default_value", (*color, 1)))


def position_emission(square: bool = False) -> bpy.types.Material:
    """Material whose light is the world position plus POSITION_OFFSET; with ``square`` its square."""
    def connect(tree: bpy.types.NodeTree, shader: bpy.types.Node) -> None:
        geometry, add = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeVectorMath")
        add.inputs[1].default_value = (0 if square else POSITION_OFFSET,) * 3
        tree.links.new(geometry.outputs["Position"], add.inputs[0])
        if square:
            add.operation = "MULTIPLY"
            tree.links.new(geometry.outputs["Position"], add.inputs[1])
        tree.links.new(add.outputs[0], shader.inputs["Color"])
    return _emission(connect)


def link(library: str | Path, kind: str, names: list[str]) -> list[bpy.types.ID]:
    """Data of a library, as "worlds" of these ``names``, linked into the open file."""
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        setattr(wanted, kind, [*names])  # becomes a list of data
    return list(getattr(wanted, kind))


def _emission(connect: Callable[[bpy.types.NodeTree, bpy.types.Node], None]) -> bpy.types.Material:
    material = bpy.data.materials.new("emission")
    compat.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    shader, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    connect(tree, shader)
    return material


def mixed(*shaders: tuple[str, dict], output: str = "Surface") -> bpy.types.Material:
    """Material of shader nodes, (type, {input: value}) each, mixed in equal parts."""
    made = bpy.data.materials.new("material")
    compat.use_nodes(made)
    tree, sockets = made.node_tree, []
    tree.nodes.clear()
    for kind, values in shaders:
        node = tree.nodes.new(kind)
        for name, value in values.items():
            node.inputs[name].default_value = value
        sockets.append(node.outputs[0])
    while len(sockets) > 1:
        mix = tree.nodes.new("ShaderNodeMixShader")
        for number in (1, 2):
            tree.links.new(sockets.pop(0), mix.inputs[number])
        sockets.append(mix.outputs[0])
    tree.links.new(sockets[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[output])
    return made


def snapshot() -> dict[str, str]:
    """Every plain setting of every data-block but images, and which data-blocks there are."""
    values = {"file": bpy.data.filepath}
    for name in ("scenes", "objects", "cameras", "worlds", "meshes", "materials", "collections", "lights",
                 "node_groups", "texts"):
        for block in getattr(bpy.data, name):
            _record(f"{name}/{block.name}", block, values)
    for scene in bpy.data.scenes:
        for part in ("render", "render.image_settings", "view_settings", "display_settings",
                     *(["cycles"] if hasattr(scene, "cycles") else [])):
            _record(f"scenes/{scene.name}.{part}", scene.path_resolve(part), values)
        for layer in scene.view_layers:
            _record(f"scenes/{scene.name}/{layer.name}", layer, values)
            if hasattr(layer, "cycles"):
                _record(f"scenes/{scene.name}/{layer.name}.cycles", layer.cycles, values)
    for camera in bpy.data.cameras:
        _record(f"cameras/{camera.name}.dof", camera.dof, values)
    if "cycles" in bpy.context.preferences.addons:
        _record("cycles preferences", bpy.context.preferences.addons["cycles"].preferences, values)
    return values


def _record(key: str, owner: bpy.types.bpy_struct, values: dict[str, str]) -> None:
    for item in owner.bl_rna.properties:
        if item.identifier == "use_nodes":  # deprecated
            continue
        value = getattr(owner, item.identifier)
        if item.type == "POINTER":
            value = getattr(value, "name_full", value is None)
        elif item.type == "COLLECTION":
            value = len(value)
        elif getattr(item, "is_array", False):
            value = tuple(tuple(row) if hasattr(row, "__len__") else row for row in value)
        values[f"{key}.{item.identifier}"] = str(value)


WAYS = ("one-pass", "lens-card")   # of tracing all views at once


def encoded(scene: bpy.types.Scene, layout: RayLayout, folder: Path, matrix_world: rig.Matrix | None = None,
            way: str = WAYS[0], **settings: object) -> dict[str, np.ndarray]:
    """Layers of a render of all views at once."""
    settings = cycles.RenderSettings(**{"samples": 1} | settings)
    cycles.render_encoded(scene, cycles.Shot(layout, matrix_world or front(), way), settings, folder / "image.exr")
    return image_files.read_layers(folder / "image.exr")


def save_box(path: Path, centre: tuple[float, ...], half: tuple[float, ...]) -> Path:
    """A file with one box, in the format of its suffix."""
    add_box(fresh_scene(), centre, half)
    if path.suffix == ".obj":
        bpy.ops.wm.obj_export(filepath=str(path))
    elif path.suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    else:
        bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB" if path.suffix == ".glb" else "GLTF_SEPARATE")
    return path


def compositing(scene, *kinds):
    """Give ``scene`` a compositor whose output passes through nodes of ``kinds``."""
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes, tree = True, scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    nodes = [tree.nodes.new(kind) for kind in ("CompositorNodeRLayers", *kinds)]
    for before, after in itertools.pairwise([*nodes, output]):
        tree.links.new(before.outputs[0], next(socket for socket in after.inputs if socket.type == "RGBA"))
    return nodes[1:]
