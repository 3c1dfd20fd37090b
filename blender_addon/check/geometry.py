"""Objects that the display cannot show well: too near, too far, too thin, or not marked as background."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator

import bpy
import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..array import rig
from ..array.rig import Placement
from ..scene.subject import GEOMETRY
from ..settings.scene_settings import length, resolve

COVERS = 0.8          # share of the display, in both directions, that makes an object its background
TOLERANCE = 1e-3      # of the display's distance


@dataclasses.dataclass(frozen=True)
class Found:
    """One object's problem."""

    # Key of its fix in ``fixes.FIXES``.
    code: str
    item: bpy.types.Object
    # A sentence for the artist.
    reason: str
    # The button's text; empty: there is no button.
    fix: str = ""


@dataclasses.dataclass(frozen=True)
class View:
    """What a scene's array shows of it."""

    scene: bpy.types.Scene
    display: DisplayProfile
    array: CameraArray
    # One view of this many in each direction is rendered.
    scale: int

    @functools.cached_property
    def limits(self) -> tuple[float, float]:
        """Nearest and farthest usable distance from the viewing position, in scene units."""
        return rig.usable_depth(self.array, self.display)


@dataclasses.dataclass(frozen=True)
class Extent:
    """An object in camera-array space."""

    # Distances from the viewing position along the view, in scene units.
    near: float
    far: float
    # Corners (2,) of the rectangle it covers, as shares of half the display.
    low: Array
    high: Array

    @property
    def visible(self) -> bool:
        """False if no eye in front of the display sees it."""
        return self.far > 0 and bool((self.low < 1).all() and (self.high > -1).all())

    @property
    def covers(self) -> bool:
        """True if it lies behind most of the display."""
        return bool(((np.minimum(self.high, 1) - np.maximum(self.low, -1)) / 2 > COVERS).all())


def find(scene: bpy.types.Scene, display: DisplayProfile, placed: Placement,
         subject: set[bpy.types.Object]) -> Iterator[Found]:
    """Problems of every visible object, by name.

    Parameters
    ----------
    scene : the scene, with its scale among its settings
    display : the display it is for
    placed : the camera array and its world matrix
    subject : objects to look at
    """
    array, matrix = placed
    view = View(scene, display, array, resolve(scene).scale)
    corners = world_corners(subject)
    inverse = np.array(rig.to_array_space(matrix))
    for item in sorted(corners, key=lambda item: item.name):
        extent = extent_of(np.concatenate(corners[item]) @ inverse[:3, :3].T + inverse[:3, 3], array)
        if extent.visible:
            yield from _problems(item, extent, view)


def world_corners(subject: set[bpy.types.Object]) -> dict[bpy.types.Object, list[Array]]:
    """World corners (8, 3) of the bounding boxes of each object of the subject and its instances."""
    corners: dict[bpy.types.Object, list[Array]] = {}
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        item = instance.object
        owner = (instance.parent if instance.is_instance else item).original
        if item.type not in GEOMETRY or not {owner, item.original} & subject or owner.hide_render:
            continue
        matrix = np.array(instance.matrix_world)
        corners.setdefault(owner, []).append(np.array(item.bound_box) @ matrix[:3, :3].T + matrix[:3, 3])
    return corners


def extent_of(points: Array, array: CameraArray) -> Extent:
    """Extent of points (n, 3) in camera-array space, seen from the viewing position."""
    depths = points[:, 2]
    half = np.array([array.half_width, array.half_height]) / array.distance
    # A point beside or behind the viewing position has no place on the display; the object surrounds it.
    seen = points[:, :2] / np.maximum(depths, 1e-6 * array.distance)[:, None] / half
    return Extent(float(depths.min()), float(depths.max()), seen.min(0), seen.max(0))


def _problems(item: bpy.types.Object, extent: Extent, view: View) -> Iterator[Found]:
    (near, far), scene, distance = view.limits, view.scene, view.array.distance
    margin = TOLERANCE * distance
    # A floor or a room: from beside the viewer, or from before the usable depth, to behind the display.
    through = extent.far > (distance if extent.near <= 0 else far) and extent.near < near
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
    least, seen = thickness(item), finest(view, extent)
    if 0 < least < seen:
        yield Found("thin", item, f"It is {length(scene, least)} thick; at its depth the rendered views see "
                    f"nothing finer than {length(scene, seen)}. Choose a smaller scale or bring it nearer to "
                    "the display plane.")


def thickness(item: bpy.types.Object) -> float:
    """The second smallest of an object's three dimensions: a rod's thickness, a sheet's shorter side."""
    return sorted(item.dimensions)[1]


def finest(view: View, extent: Extent) -> float:
    """Width at the object's depth of what one pixel of the rendered array sees: a lens or a cell of views."""
    array = view.array
    depth = min(max(array.distance, extent.near), extent.far)
    lens = 2 * array.half_width / view.display.lenses[0] * depth / array.distance
    cell = view.scale * array.spacing * abs(depth - array.distance) / array.distance
    return max(lens, cell)
