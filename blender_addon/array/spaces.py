"""Camera-array space (+X right, +Y up, +Z towards the display) <-> Blender's camera space."""

from __future__ import annotations

from collections.abc import Sequence

import mathutils

Matrix = Sequence[Sequence[float]]


def to_blender(matrix_world: Matrix) -> mathutils.Matrix:
    """World matrix of a Blender camera, which looks along -Z, for one of camera-array space, +Z forward."""
    return mathutils.Matrix(matrix_world) @ mathutils.Matrix.Diagonal((1, 1, -1, 1))


def from_blender(matrix_world: mathutils.Matrix) -> tuple[tuple[float, ...], ...]:
    """Inverse of ``to_blender``, as plain rows; scale is removed, as Cycles does."""
    place, turn, _ = matrix_world.decompose()
    rigid = mathutils.Matrix.LocRotScale(place, turn, None)
    return tuple(tuple(row) for row in rigid @ mathutils.Matrix.Diagonal((1, 1, -1, 1)))
