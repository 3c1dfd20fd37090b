"""Adding, fitting and removing the camera array of a scene."""

from __future__ import annotations

import math
from collections.abc import Collection

import bpy
import mathutils
import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile

from ..scene.subject import find_subject
from . import placement, rig
from .rig import Placement
from .spaces import to_blender

ARRAY_NAME, PLANE_NAME = "Light Field Array", "Display Plane"
SHARE_OF_DISTANCE = 0.05   # how large the handle is drawn
SPACING_HELP = "Spacing of the cameras as a share of what fills the display's viewing angle"
PLANE_HELP = "Marks the handle of a light-field camera array's display plane"


def add(scene: bpy.types.Scene, profile: DisplayProfile) -> bpy.types.Object:
    """Add a camera array where the scene's camera is, else in front of the subject, else of the origin."""
    if rig.find(scene) is not None:
        raise LfsrError(f"scene {scene.name!r} has a camera array already: fit it, or remove it first")
    rig.check_editable(scene)
    # Before the array exists, which would be taken for the scene's own.
    placed = _first_placement(scene, profile)
    array = _new_array(scene)
    put(array, placed)
    if scene.camera is None:
        scene.camera = array
    return array


def fit(scene: bpy.types.Scene, profile: DisplayProfile, items: Collection[bpy.types.Object]) -> bpy.types.Object:
    """Move the scene's array in front of ``items``, looking as it does now; adds one if there is none."""
    rig.check_editable(scene)
    array = rig.find(scene)
    if array is not None:
        rig.check_editable(array)
    # Looking along +Y with Z up, as an array that was just added does.
    turn = _view_turn(array) if array else mathutils.Matrix.Identity(3)
    placed = _fitted(items, profile, turn)
    if array is None:
        array = _new_array(scene)
        if scene.camera is None:
            scene.camera = array
    put(array, placed)
    return array


def remove(scene: bpy.types.Scene) -> None:
    """Remove the scene's camera array and its data, and planes whose array was deleted by hand."""
    array = rig.find(scene)
    if array is None:
        raise LfsrError(f"scene {scene.name!r} has no camera array to remove")
    rig.check_editable(array)
    for plane in [item for item in array.children if rig.PLANE in item]:
        bpy.data.objects.remove(plane)
    camera = array.data
    bpy.data.objects.remove(array)
    if camera.users == 0:
        bpy.data.cameras.remove(camera)
    for plane in [item for item in scene.objects if rig.PLANE in item and not rig.is_array(item.parent)]:
        bpy.data.objects.remove(plane)


def put(array: bpy.types.Object, placed: Placement) -> None:
    """Move ``array`` and its display plane to a placement."""
    layout, matrix = placed
    plane = rig.plane_of(array) or _new_plane(array)
    array.matrix_world = to_blender(matrix)
    array.data.lens = array.data.sensor_width / 2 * layout.distance / layout.half_width
    array.data.clip_start, array.data.clip_end = layout.distance / 1000, layout.distance * 100
    array.data.display_size = layout.half_width * 0.25
    plane.location = (0.0, 0.0, -layout.distance)
    plane.empty_display_size = layout.distance * SHARE_OF_DISTANCE
    bpy.context.view_layer.update()


def _new_array(scene: bpy.types.Scene) -> bpy.types.Object:
    data = bpy.data.cameras.new(ARRAY_NAME)
    data.sensor_fit = "HORIZONTAL"
    array = bpy.data.objects.new(ARRAY_NAME, data)
    array[rig.SPACING] = 1.0
    array.id_properties_ui(rig.SPACING).update(min=0.01, soft_max=1.0, default=1.0, description=SPACING_HELP)
    # The scene's own collection: visible whatever collection is excluded or hidden.
    scene.collection.objects.link(array)
    _new_plane(array)
    return array


def _new_plane(array: bpy.types.Object) -> bpy.types.Object:
    plane = bpy.data.objects.new(PLANE_NAME, None)
    plane.empty_display_type = "SINGLE_ARROW"
    plane[rig.PLANE] = True
    plane.id_properties_ui(rig.PLANE).update(description=PLANE_HELP)
    for collection in array.users_collection:
        collection.objects.link(plane)
    plane.parent = array
    # It slides along the view and does nothing else.
    plane.lock_location = (True, True, False)
    plane.lock_rotation = plane.lock_scale = (True, True, True)
    return plane


def _first_placement(scene: bpy.types.Scene, profile: DisplayProfile) -> Placement:
    try:
        return placement.place_array(scene, profile, find_subject(scene))
    except LfsrError:
        # Nothing to fit to yet: a display one unit wide at the origin is a start.
        return placement.fit_array(np.array([-0.4, -0.1, -0.2]), np.array([0.4, 0.1, 0.2]), profile)


def _view_turn(array: bpy.types.Object) -> mathutils.Matrix:
    """Rotation from an array that looks along +Y with Z up to ``array``."""
    return array.matrix_world.to_3x3().normalized() @ mathutils.Matrix.Rotation(-math.pi / 2, 3, "X")


def _fitted(items: Collection[bpy.types.Object], profile: DisplayProfile, turn: mathutils.Matrix) -> Placement:
    if not items:
        raise LfsrError("nothing is selected: select the objects that the display should show")
    points = np.concatenate(list(placement.world_points(set(items))) or [np.empty((0, 3))]) @ np.array(turn)
    if not len(points):
        raise LfsrError("the selection has no geometry: select the objects that the display should show")
    layout, matrix = placement.fit_array(points.min(0), points.max(0), profile)
    turned = turn.to_4x4() @ mathutils.Matrix(matrix)
    return layout, tuple(tuple(row) for row in turned)
