"""The far end of what a camera sees, for renders of all views at once.

Cycles ends rays of an OSL camera on a sphere and those behind a portal nowhere. So a plane stands at the depth
where the scene's camera ends, and its material, a Ray Portal too, sends what meets it past everything: the world
is all that is left to see.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import mathutils
import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.panel.panel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout

from .. import compat
from ..array.spaces import Matrix, to_blender
from .overrides import overridden

NAME = "LFSR Curtain"
SPARE = 1.5   # so much larger than what the views see
PAST = 10.0   # so many times as far as the farthest thing
_VISIBILITY = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")


@contextmanager
def curtain(scene: bpy.types.Scene, layout: RayLayout | PanelLayout, matrix_world: Matrix,
            depth: float) -> Iterator[bool]:
    """Inside the block rays of ``layout`` see no thing beyond ``depth``; True if any lies there."""
    frame = to_blender(matrix_world)
    farthest = _farthest(frame)
    if farthest <= depth:
        yield False
        return
    made: list[bpy.types.ID] = []
    try:
        screen = _screen(made, _half_side(layout, depth), PAST * farthest)
        screen.matrix_world = frame @ mathutils.Matrix.Translation((0, 0, -depth))
        scene.collection.objects.link(screen)
        with overridden(scene.cycles, {"transparent_max_bounces": scene.cycles.transparent_max_bounces + 1}):
            yield True
    finally:
        bpy.data.batch_remove(made)


def without_places(position: Array, matrix_world: Matrix, depth: float) -> Array:
    """Position layer (H, W, 3) with 0 where a ray met the curtain at ``depth``."""
    place = np.asarray(matrix_world, float)
    # A thing so near to the curtain is lost with it: single precision tells them apart no better.
    met = (position - place[:3, 3]) @ place[:3, 2] > depth * (1 - 1e-5)
    return np.where(met[..., None], np.float32(0), position)


def _farthest(frame: mathutils.Matrix) -> float:
    """Depth of the farthest corner of anything's box, in the space of ``frame``."""
    toward, depths = frame.inverted(), [0.0]
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type not in {"EMPTY", "CAMERA", "LIGHT"}:
            matrix = toward @ instance.matrix_world
            depths += [-(matrix @ mathutils.Vector(corner)).z for corner in instance.object.bound_box]
    return max(depths)


def _half_side(layout: RayLayout | PanelLayout, depth: float) -> float:
    """Half the side of the square that every ray passes at ``depth``."""
    array, reach = layout.array, layout.reach
    return SPARE * (reach + (reach + max(array.half_width, array.half_height)) * depth / array.distance)


def _screen(made: list[bpy.types.ID], half: float, past: float) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(NAME)
    screen = bpy.data.objects.new(NAME, mesh)
    made += [mesh, screen]
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(_material(made, past))
    for kind in _VISIBILITY:
        setattr(screen, f"visible_{kind}", False)
    return screen


def _material(made: list[bpy.types.ID], past: float) -> bpy.types.Material:
    material = bpy.data.materials.new(NAME)
    made.append(material)
    compat.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    geometry, move, back, portal, output = (tree.nodes.new(kind) for kind in (
        "ShaderNodeNewGeometry", "ShaderNodeVectorMath", "ShaderNodeVectorMath", "ShaderNodeBsdfRayPortal",
        "ShaderNodeOutputMaterial"))
    move.operation, back.operation = "MULTIPLY_ADD", "SCALE"
    move.inputs[1].default_value, back.inputs["Scale"].default_value = (-past,) * 3, -1.0
    for source, target in ((geometry.outputs["Incoming"], move.inputs[0]), (geometry.outputs["Position"],
                           move.inputs[2]), (geometry.outputs["Incoming"], back.inputs[0]),
                           (move.outputs["Vector"], portal.inputs["Position"]),
                           (back.outputs["Vector"], portal.inputs["Direction"]),
                           (portal.outputs[0], output.inputs["Surface"])):
        tree.links.new(source, target)
    return material
