"""Random materials: every sort the product's scenes may contain, with colours from numbers, noise or photographs."""

from __future__ import annotations

from typing import Any

import bpy


class Graph:
    """Node tree of a material, written as nested calls."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def node(self, kind: str, inputs: dict[str, Any] | None = None, **settings: Any) -> bpy.types.Node:
        """New node; an input's value is a number, a colour, a vector or another node's output."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        for name, value in (inputs or {}).items():
            self.feed(node.inputs[name], value)
        return node

    def feed(self, socket: bpy.types.NodeSocket, value: Any) -> None:
        """Link or set one input."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value
