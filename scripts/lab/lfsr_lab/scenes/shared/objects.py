"""What every script that writes scenes does: objects, materials, light and camera; its job, saving and its end."""

import argparse
import math
import os
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import bpy
import mathutils
import numpy as np

from blender_addon import compat
from blender_addon.scene.light import add_light
from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path, read_json
from lfsr_core.process.child import EXIT_BAD_INPUT, emit
from lfsr_lab.scenes.shared.surfaces import Surface


class Graph:
    """Node tree of a material or a world."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def node(self, kind: str, inputs: Mapping[Any, Any] | None = None, **settings: Any) -> bpy.types.Node:
        """New node; an input's value is a number, a colour, a vector or another node's output."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        self.set(node, inputs or {})
        return node

    def set(self, node: bpy.types.Node, inputs: Mapping[Any, Any]) -> None:
        """Link or set inputs of a node by name or number."""
        for name, value in inputs.items():
            self.feed(node.inputs[name], value)

    def feed(self, socket: bpy.types.NodeSocket, value: Any) -> None:
        """Link or set one input."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def only(self, kind: str) -> bpy.types.Node:
        """The one node of a type such as "BACKGROUND"."""
        return next(node for node in self.tree.nodes if node.type == kind)


def principled(name: str, **inputs: Any) -> tuple[bpy.types.Material, Graph, bpy.types.Node]:
    """Return a new material, its graph and its Principled shader with ``inputs`` by socket name (spaces as _)."""
    material = bpy.data.materials.new(name)
    compat.use_nodes(material)
    graph = Graph(material.node_tree)
    shader = graph.only("BSDF_PRINCIPLED")
    graph.set(shader, {key.replace("_", " "): value for key, value in inputs.items()})
    return material, graph, shader


def paint(name: str, color: tuple[float, ...], roughness: float = 0.5, **inputs: float) -> bpy.types.Material:
    """Return a Principled material of one scene-linear colour."""
    return principled(name, Base_Color=(*color, 1.0), Roughness=roughness, **inputs)[0]


Vector = Array | tuple[float, ...]  # three values


def add_surface(surface: Surface, material: bpy.types.Material | None, name: str = "part") -> bpy.types.Object:
    """Object of a surface in the scene, with its texture coordinates and one material."""
    mesh = bpy.data.meshes.new(name)
    count, corners = surface.faces.shape
    mesh.vertices.add(len(surface.vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(surface.vertices, np.float32).ravel())
    mesh.loops.add(count * corners)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(surface.faces, np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, count * corners, corners, dtype=np.int32))
    mesh.update(calc_edges=True)
    if surface.uv is not None:
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", np.ascontiguousarray(surface.uv[surface.faces.ravel()], np.float32).ravel())
    mesh.polygons.foreach_set("use_smooth", np.full(count, surface.smooth))
    return add_object(mesh, material, name)


def add_object(data: bpy.types.ID, material: bpy.types.Material | None, name: str) -> bpy.types.Object:
    """Object of a mesh, curve or light in the scene's own collection."""
    thing = bpy.data.objects.new(name, data)
    if material is not None:
        data.materials.append(material)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def put(surface: Surface, material: bpy.types.Material | None, at: Vector, size: float | Vector = 1.0,
        turn: Vector = (0, 0, 0), name: str = "part") -> bpy.types.Object:
    """Add an object of a surface and ``settle`` it."""
    thing = add_surface(surface, material, name)
    settle(thing, at, size, turn)
    return thing


def again(thing: bpy.types.Object, at: Vector, size: float | Vector = 1.0,
          turn: Vector = (0, 0, 0)) -> bpy.types.Object:
    """Add another object of the same mesh and ``settle`` it."""
    other = add_object(thing.data, None, thing.name)
    settle(other, at, size, turn)
    return other


def settle(thing: bpy.types.Object, at: Vector, size: float | Vector, turn: Vector) -> None:
    """Place, scale and rotate (Euler angles in radians)."""
    thing.location, thing.rotation_euler = at, turn
    thing.scale = np.broadcast_to(size, 3)


CAMERA_DISTANCE, DISPLAY_WIDTH = 10.0, 7.084  # of the 32-inch display, in units of 10 cm



def joined(added: list[bpy.types.Object]) -> bpy.types.Object:
    """Join the meshes of ``added`` to one in the places where they stand; all else of it is removed, skeletons too."""
    meshes = [item for item in added if item.type == "MESH" and item.data.polygons]
    for item, matrix in [(item, item.matrix_world.copy()) for item in meshes]:
        item.parent, item.matrix_world = None, mathutils.Matrix()
        item.modifiers.clear()
        item.data.transform(matrix)
    if len(meshes) > 1:
        with bpy.context.temp_override(active_object=meshes[0], selected_editable_objects=meshes):
            bpy.ops.object.join()
    for item in set(added) - set(meshes):
        bpy.data.objects.remove(item)
    return meshes[0]


def demo_camera() -> None:
    """Make an empty scene for Cycles with a camera at the viewing position of the 32-inch display.

    One unit is 10 cm: the camera looks along +Y from 1 m and focuses on the display plane, y = 0, which reaches from
    -3.5 to 3.5 in x and -2 to 2 in z.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = "CYCLES", True
    camera = bpy.data.cameras.new("Camera")
    camera.sensor_fit, camera.angle = "HORIZONTAL", 2 * math.atan(DISPLAY_WIDTH / 2 / CAMERA_DISTANCE)
    camera.dof.use_dof, camera.dof.focus_distance = True, CAMERA_DISTANCE
    scene.camera = add_object(camera, None, "Camera")
    scene.camera.location, scene.camera.rotation_euler = (0, -CAMERA_DISTANCE, 0), (math.pi / 2, 0, 0)


def world(image: str = "city", strength: float = 0.45) -> bpy.types.Node:
    """Light the scene with one of Blender's own world images, packed; return the background node."""
    graph = Graph(add_light(bpy.context.scene, image).node_tree)
    graph.only("TEX_ENVIRONMENT").image.pack()
    background = graph.only("BACKGROUND")
    background.inputs["Strength"].default_value = strength
    return background


def sun(strength: float = 1.2, angle: float = 0.1, turn: Vector = (0.7, 0.0, -0.6)) -> None:
    """Add a sun ``angle`` radians across, turned by Euler angles: from the upper left of the viewer."""
    data = bpy.data.lights.new("sun", "SUN")
    data.energy, data.angle = strength, angle
    add_object(data, None, "sun").rotation_euler = turn


def lamp(at: Vector, watts: float, size: float, color: Vector = (1, 1, 1)) -> bpy.types.Object:
    """Add a square lamp that looks at the middle of the display."""
    data = bpy.data.lights.new("lamp", "AREA")
    data.energy, data.size, data.color = watts, size, color
    thing = add_object(data, None, "lamp")
    aim(thing, at)
    return thing


def aim(thing: bpy.types.Object, at: Vector) -> None:
    """Place a lamp so that it looks at the middle of the display."""
    thing.location = at
    thing.rotation_euler = (-mathutils.Vector(at)).to_track_quat("-Z", "Y").to_euler()


def script_arguments() -> list[str]:
    """Return the script's own arguments: those after ``--`` under Blender, else all."""
    return sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]


def script_paths(description: str, **names: str) -> dict[str, Path]:
    """Return the paths among the script's own arguments, by name; ``names``: what stands for each in its help."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    for name, shown in names.items():
        parser.add_argument(name, type=Path, metavar=shown)
    return vars(parser.parse_args(script_arguments()))


def save(path: Path) -> None:
    """Write the open scene, whole or not at all."""
    with atomic_path(path.resolve()) as temporary:
        bpy.ops.wm.save_as_mainfile(filepath=str(temporary), compress=True, copy=True)
        # Blender keeps what it overwrites, here the empty temporary file.
        Path(f"{temporary}1").unlink(missing_ok=True)


def run(build: Callable[[dict[str, Any]], None], what: str) -> int:
    """Build the scenes of the JSON file that is named last, which is ``what``; exit code: 0, 2 on bad input."""
    try:
        build(read_json(script_arguments()[-1], what))
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    emit(stage="done")
    return 0


def leave(code: int) -> NoReturn:
    """End the process here, tidied by hand: Blender turns a script's SystemExit into its own exit code."""
    sys.stdout.flush()
    sys.stderr.flush()
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)
