"""Build node trees, and screens whose material sends camera rays elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import bpy

from .. import compat

HIDDEN_FROM = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")
COLUMN, ROW, ROWS = 190, 170, 4  # distances between nodes, and nodes in a column


class Wiring:
    """Adds nodes to a tree, from left to right; a value is a socket to link or a constant to set."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def node(self, kind: str, **inputs: Any) -> bpy.types.Node:
        """Return a new node with the values of ``inputs``, by name."""
        node = self.tree.nodes.new(kind)
        column, row = divmod(len(self.tree.nodes) - 1, ROWS)
        node.location = (COLUMN * column, -ROW * row)
        for name, value in inputs.items():
            self.link(value, node.inputs[name])
        return node

    def link(self, value: Any, socket: bpy.types.NodeSocket) -> None:
        """Give ``socket`` a value."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def vector(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Return the result of a Vector Math node."""
        return self._operation("ShaderNodeVectorMath", operation, values)

    def scalar(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Return the result of a Math node."""
        return self._operation("ShaderNodeMath", operation, values)

    def _operation(self, kind: str, operation: str, values: tuple[Any, ...]) -> bpy.types.NodeSocket:
        node = self.node(kind)
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.link(value, socket)
        return node.outputs[0]


# Adds nodes for a ray: the inputs of its portal, by name.
Ray = Callable[[Wiring], Mapping[str, bpy.types.NodeSocket]]


def new_screen(made: list[bpy.types.ID], name: str, ray: Ray) -> bpy.types.Object:
    """Return an object with an empty mesh that sends camera rays on as ``ray``, by a Ray Portal BSDF.

    Only the camera sees it. It is in no scene; all new data is added to ``made``.
    """
    mesh = bpy.data.meshes.new(name)
    screen = bpy.data.objects.new(name, mesh)
    material = bpy.data.materials.new(name)
    made += [mesh, screen, material]
    for kind in HIDDEN_FROM:
        setattr(screen, f"visible_{kind}", False)
    compat.use_nodes(material)
    material.node_tree.nodes.clear()
    wiring = Wiring(material.node_tree)
    portal = wiring.node("ShaderNodeBsdfRayPortal", **ray(wiring))
    wiring.node("ShaderNodeOutputMaterial", Surface=portal.outputs[0])
    mesh.materials.append(material)
    return screen
