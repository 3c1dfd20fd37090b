"""Add, fit and remove the camera array of a scene."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Collection

import bpy
import mathutils
import numpy as np

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..subject import find_subject
from . import front, placement, rig
from .rig import Placement
from .spaces import from_blender, to_blender, upright
from .view import View

ARRAY_NAME, PLANE_NAME = "Light Field Array", "Display Plane"
HANDLE_SIZE = 0.05  # as a fraction of the distance to the display plane
SPACING_HELP = "Spacing of the cameras as a fraction of the spacing that fills the display's viewing angle"
PLANE_HELP = "Marks the display plane of a light-field camera array"


def add(scene: bpy.types.Scene, profile: DisplayProfile) -> bpy.types.Object:
    """Add a camera array at the scene's camera, else in front of the subject, else in front of the origin."""
    if rig.find(scene) is not None:
        raise LfsrError(f"scene {scene.name!r} has a camera array already: fit it, or remove it first")
    rig.check_editable(scene)
    # Before the array exists: it would be taken for the scene's own.
    placed = front.first_placement(scene, profile)
    array = _new_array(scene)
    put(array, placed)
    return array


def fit(scene: bpy.types.Scene, profile: DisplayProfile, items: Collection[bpy.types.Object]) -> bpy.types.Object:
    """Move the scene's array in front of ``items``, in its present direction; add one if there is none."""
    rig.check_editable(scene)
    array = rig.find(scene)
    # Rotation from a new array, which looks along +Y with Z up.
    turn = mathutils.Matrix.Identity(3)
    if array is not None:
        rig.check_editable(array)
        turn = upright(array).to_3x3() @ mathutils.Matrix.Rotation(-math.pi / 2, 3, "X")
    if not items:
        raise LfsrError("nothing is selected: select the objects that the display should show")
    points = np.concatenate(list(placement.world_points(set(items))) or [np.empty((0, 3))])
    if not len(points):
        raise LfsrError("the selection has no geometry: select the objects that the display should show")
    placed = front.fit_turned(points, profile, turn)
    array = array or _new_array(scene)
    put(array, placed)
    return array


def fit_to_camera(scene: bpy.types.Scene, profile: DisplayProfile) -> bpy.types.Object:
    """Move the scene's array to its active camera; add one if there is none."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        raise LfsrError(f"scene {scene.name!r} has no active camera: add one, or fit to the view")
    if rig.is_array(camera):
        raise LfsrError(f"the active camera {camera.name!r} is the camera array itself: make another camera active, or "
                        "fit to the view")
    return _moved(scene, placement.array_of_camera(scene, profile, find_subject(scene)))


def fit_to_view(scene: bpy.types.Scene, profile: DisplayProfile, view: View) -> bpy.types.Object:
    """Move the scene's array so that the display shows what a 3D view shows; add one if there is none."""
    if view.is_perspective:
        subject = set[bpy.types.Object]()
        with contextlib.suppress(LfsrError):
            subject = find_subject(scene)
        placed = placement.array_of_view(scene, profile, subject, view)
    else:
        # A parallel view has no eye: the display stands at its centre, and viewers at their distance from it.
        array = CameraArray.for_display(profile, 2 * view.half_width)
        moved = mathutils.Matrix.Translation((0, 0, array.distance))
        placed = array, from_blender(mathutils.Matrix(view.matrix) @ moved)
    return _moved(scene, placed)


def remove(scene: bpy.types.Scene) -> None:
    """Remove the scene's camera array with its data, and display planes whose array was deleted by hand."""
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


def _moved(scene: bpy.types.Scene, placed: Placement) -> bpy.types.Object:
    """Array of the scene, added if there is none, at a placement."""
    rig.check_editable(scene)
    array = rig.find(scene)
    if array is not None:
        rig.check_editable(array)
    array = array or _new_array(scene)
    put(array, placed)
    return array


def put(array: bpy.types.Object, placed: Placement) -> None:
    """Move ``array`` and its display plane to a placement."""
    layout, matrix = placed
    plane = rig.plane_of(array) or _new_plane(array)
    array.matrix_world = to_blender(matrix)
    array.data.lens = array.data.sensor_width / 2 * layout.distance / layout.half_width
    array.data.clip_start, array.data.clip_end = layout.distance / 1000, layout.distance * 100
    array.data.display_size = layout.half_width * 0.25
    plane.location = (0.0, 0.0, -layout.distance)
    plane.empty_display_size = layout.distance * HANDLE_SIZE
    bpy.context.view_layer.update()


def _new_array(scene: bpy.types.Scene) -> bpy.types.Object:
    """Array of the scene, which becomes the active camera if there is none."""
    data = bpy.data.cameras.new(ARRAY_NAME)
    data.sensor_fit = "HORIZONTAL"
    data.show_passepartout = False  # its frame is the scene's, not the display's
    array = bpy.data.objects.new(ARRAY_NAME, data)
    array[rig.SPACING] = 1.0
    array.id_properties_ui(rig.SPACING).update(min=0.01, soft_max=1.0, default=1.0, description=SPACING_HELP)
    # The scene's own collection cannot be excluded or hidden.
    scene.collection.objects.link(array)
    _new_plane(array)
    if scene.camera is None:
        scene.camera = array
    return array


def _new_plane(array: bpy.types.Object) -> bpy.types.Object:
    plane = bpy.data.objects.new(PLANE_NAME, None)
    plane.empty_display_type = "SINGLE_ARROW"
    plane[rig.PLANE] = True
    plane.id_properties_ui(rig.PLANE).update(description=PLANE_HELP)
    for collection in array.users_collection:
        collection.objects.link(plane)
    plane.parent = array
    # It only slides along the view.
    plane.lock_location = (True, True, False)
    plane.lock_rotation = plane.lock_scale = (True, True, True)
    return plane
