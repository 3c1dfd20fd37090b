"""Screens that only the camera sees, whose material (a Ray Portal BSDF) sends camera rays elsewhere."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .. import compat
from .wiring import Wiring

HIDDEN_FROM = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")
# Adds nodes for a ray: the sockets of its position and direction.
Ray = Callable[[Wiring], tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]]


def new_screen(made: list[bpy.types.ID], name: str, ray: Ray) -> bpy.types.Object:
    """Return an object with an empty mesh and a portal to ``ray``, in no scene; all new data is added to ``made``."""
    mesh = bpy.data.meshes.new(name)
    screen = bpy.data.objects.new(name, mesh)
    material = bpy.data.materials.new(name)
    made += [mesh, screen, material]
    for kind in HIDDEN_FROM:
        setattr(screen, f"visible_{kind}", False)
    compat.use_nodes(material)
    material.node_tree.nodes.clear()
    wiring = Wiring(material.node_tree)
    position, direction = ray(wiring)
    portal = wiring.node("ShaderNodeBsdfRayPortal", Position=position, Direction=direction)
    wiring.node("ShaderNodeOutputMaterial", Surface=portal.outputs[0])
    mesh.materials.append(material)
    return screen
