"""The far clipping plane of a camera, for renders of all views at once.

Cycles ends the rays of an OSL camera on a sphere, and never ends those behind a portal. Instead, a plane at
the clipping depth sends the rays that meet it past all objects, so that they only see the world.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import mathutils

from lfsr_core.optics.panel.panel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout

from ..scene.array.spaces import Matrix, to_blender
from ..scene.overrides import new_data, overridden
from .card_parts import Wiring, new_screen

NAME = "LFSR Clip Plane"
SPARE = 1.5   # size of the plane, as a multiple of what the views see
PAST = 10.0   # how far rays are sent, as a multiple of the depth of the farthest object


@contextmanager
def clip_plane(scene: bpy.types.Scene, layout: RayLayout | PanelLayout, matrix_world: Matrix,
               depth: float) -> Iterator[bool]:
    """Hide everything beyond ``depth`` from the rays of ``layout`` inside the block; yield True if anything is."""
    frame = to_blender(matrix_world)
    toward, depths = frame.inverted(), [0.0]  # of the corners of all objects' bounding boxes
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type not in {"EMPTY", "CAMERA", "LIGHT"}:
            matrix = toward @ instance.matrix_world
            depths += [-(matrix @ mathutils.Vector(corner)).z for corner in instance.object.bound_box]
    farthest = max(depths)
    if farthest <= depth:
        yield False
        return

    def ray(wiring: Wiring) -> dict[str, bpy.types.NodeSocket]:
        geometry = wiring.node("ShaderNodeNewGeometry").outputs
        far = wiring.vector("MULTIPLY_ADD", geometry["Incoming"], (-PAST * farthest,) * 3, geometry["Position"])
        return {"Position": far, "Direction": wiring.vector("MULTIPLY", geometry["Incoming"], (-1.0,) * 3)}

    with new_data() as made:
        # Every ray passes through a square of this size at the depth.
        array, reach = layout.array, layout.reach
        half = SPARE * (reach + (reach + max(array.half_width, array.half_height)) * depth / array.distance)
        screen = new_screen(made, NAME, ray)
        corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
        screen.data.from_pydata(corners, [], [(0, 1, 2, 3)])
        screen.matrix_world = frame @ mathutils.Matrix.Translation((0, 0, -depth))
        scene.collection.objects.link(screen)
        with overridden(scene.cycles, {"transparent_max_bounces": scene.cycles.transparent_max_bounces + 1}):
            yield True
