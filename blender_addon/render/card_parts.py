"""What cards are made of: node trees, screens that send camera rays elsewhere, the camera behind a card and its place.

The lens card, the panel card, the clip plane and the live view use these.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import bpy
import mathutils
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.rays import CameraArray

from .. import compat

NAME = "LFSR Lens Card"
HIDDEN_FROM = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")
COLUMN, ROW, ROWS = 190, 170, 4  # distances between nodes, and nodes in a column
GAP = 1e-4                    # from the camera to the camera plane, as a fraction of the display distance
# What the camera sees in front of the card, as a fraction of the distance to the world's origin: no more than single
# precision needs, since a surface there would be seen instead of the card.
CLEAR = 4e-6
LEAST_CLEAR = 1e-6            # scene units: Blender clips nothing nearer
# Half the side of the square of the camera's own aperture, as a fraction of its distance to the card: small enough
# for rays to meet the card within their pixel, and large enough for single precision.
SLANT = 2e-3


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


def new_screen(made: list[bpy.types.ID], name: str,
               ray: Callable[[Wiring], Mapping[str, bpy.types.NodeSocket]]) -> bpy.types.Object:
    """Return an object with an empty mesh that sends camera rays on, by a Ray Portal BSDF with the inputs of ``ray``.

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


@dataclasses.dataclass(frozen=True)
class Place:
    """Places along the array's axis, in scene units."""

    gap: float  # from the camera to the camera plane; the card is half way
    clear: float  # what the camera sees in front of the card
    start: float  # where rays start, as a fraction of the way from the camera plane to the display plane


def place_of(array: CameraArray, far: float, clip_start: float = 0.0) -> Place:
    """Return the places for an array at the distance ``far`` from the world's origin, with rays from ``clip_start``."""
    clear = max(CLEAR * max(far, array.distance), LEAST_CLEAR)
    return Place(max(GAP * array.distance, 4 * clear), clear, clip_start / array.distance)


def new_camera(made: list[bpy.types.ID], width: float, spreads: bool, place: Place) -> bpy.types.Object:
    """Return a camera that sees ``width`` of a card, in no scene and not placed; it and its data are added to ``made``.

    ``spreads``: whether rays of a pixel meet the card in many directions, which are random numbers for its material.
    """
    data = bpy.data.cameras.new(NAME)
    camera = bpy.data.objects.new(NAME, data)
    made += [data, camera]
    data.type, data.sensor_fit = "ORTHO", "HORIZONTAL"
    data.ortho_scale = width
    data.clip_start, data.clip_end = place.gap / 2 - place.clear, place.gap
    data.dof.use_dof = spreads
    data.dof.focus_object, data.dof.focus_distance = None, place.gap / 2
    data.dof.aperture_blades, data.dof.aperture_rotation, data.dof.aperture_ratio = 4, 0.0, 1.0
    # An orthographic camera's aperture has the radius 1 / (2 · f-stop); the corners of a square lie on it.
    data.dof.aperture_fstop = 1 / (2 * math.sqrt(2) * SLANT * place.gap / 2)
    return camera


def add_quads(mesh: bpy.types.Mesh, corners: Array) -> None:
    """Add a quad to an empty ``mesh`` for each four of ``corners`` (quads, 4, 2)."""
    count = len(corners)
    mesh.vertices.add(4 * count)
    mesh.loops.add(4 * count)
    mesh.polygons.add(count)
    mesh.vertices.foreach_set("co", with_z(corners.reshape(-1, 2), 0.0))
    mesh.loops.foreach_set("vertex_index", range(4 * count))
    mesh.polygons.foreach_set("loop_start", range(0, 4 * count, 4))


def with_z(points: Array, z: float) -> Array:
    """Return points (n, 2) as vectors, one after the other."""
    return np.column_stack([points, np.full(len(points), z)]).astype("f4").ravel()


def random_pair(wiring: Wiring) -> bpy.types.NodeSocket:
    """Return a vector with two random numbers from -SLANT to SLANT, from the camera's aperture."""
    incoming = wiring.node("ShaderNodeNewGeometry").outputs["Incoming"]
    return _transformed(wiring, incoming, "VECTOR", "WORLD", "CAMERA")


def sent(wiring: Wiring, begin: bpy.types.NodeSocket, way: bpy.types.NodeSocket) -> dict[str, bpy.types.NodeSocket]:
    """Return the portal's inputs for a ray from ``begin`` along ``way``, both in the camera's space."""
    # Transformed as a normal, the direction has length 1, which Cycles needs before 5.2.
    return {"Position": _transformed(wiring, begin, "POINT", "CAMERA", "WORLD"),
            "Direction": _transformed(wiring, way, "NORMAL", "CAMERA", "WORLD")}


def _transformed(wiring: Wiring, vector: bpy.types.NodeSocket, kind: str, of: str, to: str) -> bpy.types.NodeSocket:
    node = wiring.node("ShaderNodeVectorTransform", Vector=vector)
    node.vector_type, node.convert_from, node.convert_to = kind, of, to
    return node.outputs["Vector"]


def distance_to_volume(scene: bpy.types.Scene, point: mathutils.Vector) -> float:
    """Return the scene units from ``point``, inside or outside, to the nearest surface of a volume; inf without any.

    Volumes are meshes with a volume shader, and volume objects (their bounding boxes). Instances are ignored.
    """
    graph = bpy.context.evaluated_depsgraph_get()
    distances = [math.inf]
    for item in scene.objects:
        trees = (slot.material.node_tree for slot in item.material_slots if slot.material is not None)
        outputs = (node for tree in trees if tree for node in tree.nodes
                   if node.bl_idname == "ShaderNodeOutputMaterial")
        if not item.hide_render and (item.type == "VOLUME" or any(node.inputs["Volume"].is_linked for node in outputs)):
            distances.append(_distance(item.evaluated_get(graph), point))
    return min(distances)


def _distance(item: bpy.types.Object, point: mathutils.Vector) -> float:
    if item.type == "MESH" and item.data.polygons:
        is_there, nearest, _, _ = item.closest_point_on_mesh(item.matrix_world.inverted_safe() @ point)
        if is_there:
            return (item.matrix_world @ nearest - point).length
    corners = [item.matrix_world @ mathutils.Vector(corner) for corner in item.bound_box]
    low, high = (mathutils.Vector(map(end, zip(*corners, strict=True))) for end in (min, max))
    outside = mathutils.Vector(max(low[i] - point[i], 0, point[i] - high[i]) for i in range(3)).length
    return outside or min(min(point[i] - low[i], high[i] - point[i]) for i in range(3))
