"""Node trees written as nested calls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy

from blender_addon import compat


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
