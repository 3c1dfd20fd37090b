"""Conversion between camera-array space (+X right, +Y up, +Z towards the display) and Blender's camera space."""

from __future__ import annotations

from collections.abc import Sequence

import mathutils

Matrix = Sequence[Sequence[float]]


def to_blender(matrix_world: Matrix) -> mathutils.Matrix:
    """Return the world matrix of a Blender camera, which looks along -Z, for one of camera-array space."""
    return mathutils.Matrix(matrix_world) @ mathutils.Matrix.Diagonal((1, 1, -1, 1))


def from_blender(matrix_world: mathutils.Matrix) -> tuple[tuple[float, ...], ...]:
    """Return the inverse of ``to_blender`` as four rows of four; scale is removed, as Cycles does."""
    place, turn, _ = matrix_world.decompose()
    rigid = mathutils.Matrix.LocRotScale(place, turn, None)
    return tuple(tuple(row) for row in rigid @ mathutils.Matrix.Diagonal((1, 1, -1, 1)))
