"""Objects that the display cannot show well: too near, too far, too thin, or not marked as background."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import bpy
import numpy as np

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..array import rig
from ..array.rig import Placement
from ..scene.subject import GEOMETRY
from ..settings.scene_settings import length

COVERS = 0.8          # share of the display, in both directions, that makes an object its background
TOLERANCE = 1e-3      # of the display's distance


@dataclasses.dataclass(frozen=True)
class Found:
    """One object's problem."""

    code: str
    item: bpy.types.Object
    reason: str
    fix: str = ""


@dataclasses.dataclass(frozen=True)
class Extent:
    """An object in camera-array space: its depths and, as shares of half the display, the rectangle it covers."""

    near: float
    far: float
    low: np.ndarray
    high: np.ndarray

    @property
    def visible(self) -> bool:
        """False if no eye in front of the display sees it."""
        return self.far > 0 and bool((self.low < 1).all() and (self.high > -1).all())

    @property
    def covers(self) -> bool:
        """True if it lies behind most of the display."""
        return bool(((np.minimum(self.high, 1) - np.maximum(self.low, -1)) / 2 > COVERS).all())


def find(scene: bpy.types.Scene, display: DisplayProfile, placed: Placement, subject: set[bpy.types.Object],
         scale: int) -> Iterator[Found]:
    """Problems of every visible object of the subject, by name."""
    array, matrix = placed
    limits = rig.usable_depth(array, display)
    corners = world_corners(subject)
    inverse = np.array(rig.to_array_space(matrix))
    for item in sorted(corners, key=lambda item: item.name):
        extent = extent_of(np.concatenate(corners[item]) @ inverse[:3, :3].T + inverse[:3, 3], array)
        if extent.visible:
            yield from _problems(scene, item, extent, array, display, limits, scale)


def world_corners(subject: set[bpy.types.Object]) -> dict[bpy.types.Object, list[np.ndarray]]:
    """World corners (8, 3) of the bounding boxes of each object of the subject and its instances."""
    corners: dict[bpy.types.Object, list[np.ndarray]] = {}
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        item = instance.object
        owner = (instance.parent if instance.is_instance else item).original
        if item.type not in GEOMETRY or not {owner, item.original} & subject or owner.hide_render:
            continue
        matrix = np.array(instance.matrix_world)
        corners.setdefault(owner, []).append(np.array(item.bound_box) @ matrix[:3, :3].T + matrix[:3, 3])
    return corners


def extent_of(points: np.ndarray, array: CameraArray) -> Extent:
    """Extent of points (n, 3) in camera-array space, seen from the viewing position."""
    depths = points[:, 2]
    half = np.array([array.half_width, array.half_height]) / array.distance
    # A point beside or behind the viewing position has no place on the display; the object surrounds it.
    seen = points[:, :2] / np.maximum(depths, 1e-6 * array.distance)[:, None] / half
    return Extent(float(depths.min()), float(depths.max()), seen.min(0), seen.max(0))


def _problems(scene: bpy.types.Scene, item: bpy.types.Object, extent: Extent, array: CameraArray,
              display: DisplayProfile, limits: tuple[float, float], scale: int) -> Iterator[Found]:
    near, far = limits
    margin = TOLERANCE * array.distance
    # A floor or a room: from beside the viewer, or from before the usable depth, to behind the display.
    through = extent.far > (array.distance if extent.near <= 0 else far) and extent.near < near
    if through or (extent.covers and extent.far > far + margin):
        yield Found("background", item, "It fills the display or all of its depth, so every lens would count "
                    "as foreground. Objects in a collection called Background are reconstructed faster.",
                    "Move to Background")
        return
    if extent.near < near - margin:
        yield Found("depth", item, f"It comes within {length(scene, extent.near)} of the viewing position; "
                    f"nearer than {length(scene, near)} the display blurs it.")
    elif extent.far > far + margin:
        yield Found("depth", item, f"It reaches {length(scene, extent.far)} from the viewing position; beyond "
                    f"{length(scene, far)} the display blurs it.")
    least, seen = thickness(item), finest(array, display, extent, scale)
    if 0 < least < seen:
        yield Found("thin", item, f"It is {length(scene, least)} thick; at its depth the rendered views see "
                    f"nothing finer than {length(scene, seen)}. Choose a smaller scale or bring it nearer to "
                    "the display plane.")


def thickness(item: bpy.types.Object) -> float:
    """The second smallest of an object's three dimensions: a rod's thickness, a sheet's shorter side."""
    return sorted(item.dimensions)[1]


def finest(array: CameraArray, display: DisplayProfile, extent: Extent, scale: int) -> float:
    """Width at the object's depth of what one pixel of the rendered array sees: a lens or a cell of views."""
    depth = min(max(array.distance, extent.near), extent.far)
    lens = 2 * array.half_width / display.lenses[0] * depth / array.distance
    cell = scale * array.spacing * abs(depth - array.distance) / array.distance
    return max(lens, cell)
