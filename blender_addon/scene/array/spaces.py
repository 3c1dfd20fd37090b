"""Conversion between camera-array space (+X right, +Y up, +Z towards the display) and Blender's camera space."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import mathutils

from lfsr_core.base.errors import LfsrError

FLAT = 1e-6  # determinant of three axes of length 1 that are not three directions
Matrix = Sequence[Sequence[float]]


def to_blender(matrix_world: Matrix) -> mathutils.Matrix:
    """Return the world matrix of a Blender camera, which looks along -Z, for one of camera-array space."""
    return mathutils.Matrix(matrix_world) @ mathutils.Matrix.Diagonal((1, 1, -1, 1))


def from_blender(matrix_world: mathutils.Matrix) -> tuple[tuple[float, ...], ...]:
    """Return the inverse of ``to_blender`` as four rows of four; scale is removed, as Cycles does."""
    place, turn, _ = matrix_world.decompose()
    rigid = mathutils.Matrix.LocRotScale(place, turn, None)
    return tuple(tuple(row) for row in rigid @ mathutils.Matrix.Diagonal((1, 1, -1, 1)))


def is_mirrored(item: bpy.types.Object) -> bool:
    """Return True if negative scales, the object's or its parents', make ``item`` its own mirror image."""
    return bool(item.matrix_world.normalized().to_3x3().determinant() < 0)


def upright(item: bpy.types.Object) -> mathutils.Matrix:
    """Return the world matrix of a camera without scale and mirror: it looks the same way, and up stays up.

    LfsrError where a scale of 0 leaves it no direction.
    """
    matrix = item.matrix_world.normalized()
    if not abs(matrix.to_3x3().determinant()) > FLAT:
        raise LfsrError(f"camera {item.name!r} has no direction, because it or its parent has a scale of 0: set the "
                        "scale to 1")
    if is_mirrored(item):
        matrix.col[0] = -matrix.col[0]
    return matrix
