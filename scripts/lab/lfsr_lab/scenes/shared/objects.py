"""Surfaces and other data as objects in the open scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
import numpy as np

from blender_addon import compat
from lfsr_core.base.arrays import Array
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
