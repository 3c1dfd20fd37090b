"""Distance from a point to the volumes of a scene."""

from __future__ import annotations

import math

import bpy
import mathutils


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
