"""Rays through what the viewport shows, also among thousands of objects."""

from __future__ import annotations

import contextlib

import bpy
import mathutils
import numpy as np

ROOM = 1 + 1e-6  # spheres are larger than their boxes by rounding
TINY = 1e-30  # in place of 0 where a ray is parallel to the sides of boxes
FEW = 100  # objects up to which Blender's own search, which asks each of them, is the fastest
MOST_REACH = 1.70141e38  # Blender's value for a ray without end

Hit = tuple[mathutils.Vector, mathutils.Vector, bpy.types.Object]  # place, normal of the surface, what is hit


class Rays:
    """The scene as it is now: an edit calls for new ones."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        """Note the bounding boxes of all meshes where there are more than FEW objects."""
        self.scene, self.depsgraph = scene, bpy.context.evaluated_depsgraph_get()
        self.items: list[tuple[bpy.types.Object, mathutils.Matrix]] = []
        if len(scene.objects) <= FEW:
            return
        boxes, shapes = [], dict[int, list[tuple[float, ...]]]()
        for instance in self.depsgraph.object_instances:
            item = instance.object
            if item.type == "MESH":
                key = item.data.as_pointer()  # which an object has alone where modifiers change it
                if key not in shapes:
                    shapes[key] = [tuple(corner) for corner in item.bound_box]
                boxes.append(shapes[key])
                self.items.append((item.original, instance.matrix_world.copy()))
        if self.items:
            matrices = np.array([matrix for _, matrix in self.items])
            points = np.einsum("nij,nkj->ink", matrices[:, :3, :3], np.array(boxes)) + matrices[:, :3, 3].T[..., None]
            self.low, self.high = points.min(-1), points.max(-1)
            self.middles = (self.low + self.high).T / 2
            self.radii = np.linalg.norm(self.high - self.low, axis=0) * ROOM / 2

    def cast(self, start: mathutils.Vector, way: mathutils.Vector, reach: float = MOST_REACH) -> Hit | None:
        """Return what a ray meets first within ``reach``; hair and volumes let it pass."""
        if not self.items:
            found, place, normal, _, item, _ = self.scene.ray_cast(self.depsgraph, start, way, distance=reach)
            return (place, normal, item.original) if found else None
        way = way.normalized()
        # First the spheres around all boxes, then the few boxes that are left.
        apart = self.middles - np.array(start)
        along = apart @ np.array(way)
        near = np.flatnonzero((np.einsum("ij,ij->i", apart, apart) - along**2 <= self.radii**2)
                              & (along >= -self.radii) & (along - self.radii <= reach))
        place, slopes = np.array(start)[:, None], np.array([[part or TINY] for part in way])
        first, second = (self.low[:, near] - place) / slopes, (self.high[:, near] - place) / slopes
        enters, leaves = np.minimum(first, second).max(0), np.maximum(first, second).min(0)
        met = np.flatnonzero((leaves >= np.maximum(enters, 0)) & (enters <= reach))
        best, nearest = None, reach
        for index in met[np.argsort(enters[met])]:
            if enters[index] > nearest:
                break
            item, matrix = self.items[near[index]]
            with contextlib.suppress(RuntimeError, ValueError):  # it has no mesh of its own, or no size
                inverse = matrix.inverted()
                found, at, normal, _ = item.evaluated_get(self.depsgraph).ray_cast(
                    inverse @ start, inverse.to_3x3() @ way)
                at = matrix @ at
                if found and (at - start).length <= nearest:
                    nearest = (at - start).length
                    best = at, (inverse.to_3x3().transposed() @ normal).normalized(), item
        return best
