"""Build node trees: add nodes and link them."""

from __future__ import annotations

from typing import Any

import bpy

COLUMN, ROW, ROWS = 190, 170, 4  # distances between nodes, and nodes in a column


class Wiring:
    """Adds nodes to a tree, from left to right.

    A value is a socket to link, or a constant to set.
    """

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
