"""Find objects that the display cannot show well: too near, too far, too thin, or not marked as background."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import bpy
import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..array import placement, rig
from ..scene.subject import GEOMETRY
from ..settings.scene_settings import length, resolve
from .problem import Problem

COVERS = 0.8          # fraction of the display, in both directions, beyond which an object is its background
TOLERANCE = 1e-3      # of the display's distance


@dataclasses.dataclass(frozen=True)
class Extent:
    """Extent of an object in camera-array space."""

    near: float  # distances from the viewing position along the view, in scene units
    far: float
    low: Array  # corners (2,) of the rectangle that it covers, as fractions of half the display
    high: Array

    @property
    def visible(self) -> bool:
        """False if no eye in front of the display sees it."""
        return self.far > 0 and bool((self.low < 1).all() and (self.high > -1).all())

    @property
    def covers(self) -> bool:
        """True if it lies behind most of the display."""
        return bool(((np.minimum(self.high, 1) - np.maximum(self.low, -1)) / 2 > COVERS).all())


def find(scene: bpy.types.Scene, display: DisplayProfile, placed: rig.Placement,
         subject: set[bpy.types.Object]) -> Iterator[Problem]:
    """Problems of the visible objects of ``subject``, by name; ``placed``: the camera array and its world matrix."""
    array, matrix = placed
    corners: dict[bpy.types.Object, list[Array]] = {}  # world corners (8, 3) of bounding boxes
    for item, owner, place in placement.instances(subject):
        if item.type in GEOMETRY and not owner.hide_render:
            corners.setdefault(owner, []).append(np.array(item.bound_box) @ place[:3, :3].T + place[:3, 3])
    inverse = np.linalg.inv(np.array(matrix))
    for item in sorted(corners, key=lambda item: item.name):
        extent = extent_of(np.concatenate(corners[item]) @ inverse[:3, :3].T + inverse[:3, 3], array)
        if extent.visible:
            yield from _problems(item, extent, scene, display, array)


def extent_of(points: Array, array: CameraArray) -> Extent:
    """Return the extent of points (n, 3) in camera-array space, seen from the viewing position."""
    depths = points[:, 2]
    half = np.array([array.half_width, array.half_height]) / array.distance
    # Points beside or behind the viewing position are off the display, far out: the object surrounds the viewer.
    seen = points[:, :2] / np.maximum(depths, 1e-6 * array.distance)[:, None] / half
    return Extent(float(depths.min()), float(depths.max()), seen.min(0), seen.max(0))


def _problems(item: bpy.types.Object, extent: Extent, scene: bpy.types.Scene, display: DisplayProfile,
              array: CameraArray) -> Iterator[Problem]:
    distance, (near, far) = array.distance, rig.usable_depth(array, display)
    margin = TOLERANCE * distance
    # A floor or a room begins beside the viewer, or in front of the usable depth, and ends behind the display.
    through = extent.far > (distance if extent.near <= 0 else far) and extent.near < near
    if through or (extent.covers and extent.far > far + margin):
        yield _problem("background", item, "It fills the display or its whole depth, so every lens counts as "
                       "foreground. Objects in a collection called Background are reconstructed faster.",
                       "Move to Background")
        return
    if extent.near < near - margin:
        yield _problem("depth", item, f"It comes within {length(scene, extent.near)} of the viewing position. The "
                       f"display blurs what is nearer than {length(scene, near)}.")
    elif extent.far > far + margin:
        yield _problem("depth", item, f"It reaches {length(scene, extent.far)} from the viewing position. The "
                       f"display blurs what is farther than {length(scene, far)}.")
    thickness = sorted(item.dimensions)[1]  # of a rod; of a sheet, its shorter side
    seen = finest(extent, display, array, resolve(scene).scale)
    if 0 < thickness < seen:
        yield _problem("thin", item, f"It is {length(scene, thickness)} thick, but at its depth the rendered views "
                       f"show nothing finer than {length(scene, seen)}. Choose a smaller scale or move it nearer to "
                       "the display plane.")


def _problem(code: str, item: bpy.types.Object, reason: str, fix: str = "") -> Problem:
    return Problem(code, item.name, reason, fix, is_object=True)


def finest(extent: Extent, display: DisplayProfile, array: CameraArray, scale: int) -> float:
    """Return the width, at the object's depth, of one pixel of the rendered array: a lens or a cell of views."""
    depth = min(max(array.distance, extent.near), extent.far)
    lens = 2 * array.half_width / display.lenses[0] * depth / array.distance
    cell = scale * array.spacing * abs(depth - array.distance) / array.distance
    return max(lens, cell)
