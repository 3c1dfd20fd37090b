"""The camera array in the scene: a camera at the viewing position and an empty on the display plane.

The camera's horizontal field of view frames the display; its child, the empty, marks the plane of zero parallax.
Custom properties mark both, so that the array is also found where this add-on is not enabled (a render farm).
"""

import dataclasses
import math
from collections.abc import Iterable, Sequence

import bpy
import mathutils

from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

SPACING, PLANE = "lfsr_spacing", "lfsr_display_plane"
# An array and its world matrix.
Placement = tuple[CameraArray, tuple[tuple[float, ...], ...]]


def is_array(item: bpy.types.Object | None) -> bool:
    """Return True if ``item`` is the viewing position of a camera array."""
    return item is not None and item.type == "CAMERA" and SPACING in item


def find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the scene's camera array: its active camera if that is one, else the first by name, else None."""
    return chosen(scene, scene.objects)


def chosen(scene: bpy.types.Scene, items: Iterable[bpy.types.Object]) -> bpy.types.Object | None:
    """Return the scene's camera array among ``items``, as ``find`` does."""
    if is_array(scene.camera):
        return scene.camera
    return min((item for item in items if is_array(item)), key=lambda item: item.name, default=None)


def forget(scene: bpy.types.Scene) -> None:
    """Turn every camera array of the scene into an ordinary camera."""
    for item in scene.objects:
        if is_array(item):
            del item[SPACING]


def plane_of(array: bpy.types.Object | None) -> bpy.types.Object | None:
    """Return the empty on the display plane; None without an array or if the empty was deleted."""
    return next((item for item in array.children if PLANE in item), None) if array else None


def distance_to(plane: bpy.types.Object | None) -> float:
    """Return the distance from the viewing position to a display plane in scene units; 0 without one."""
    if plane is None:
        return 0.0
    place = plane.parent.matrix_world
    return place.col[2].to_3d().normalized().dot(place.translation - plane.matrix_world.translation)


def set_distance(scene: bpy.types.Scene, distance: float) -> None:
    """Move the display plane to ``distance`` scene units from the viewing position."""
    if (plane := plane_of(find(scene))) is not None:
        # World matrices change at an update only: first for the array's scale, then for the moved plane.
        bpy.context.view_layer.update()
        plane.location = (0.0, 0.0, -distance / (plane.parent.matrix_world.col[2].to_3d().length or 1.0))
        bpy.context.view_layer.update()


def spacing_of(array: bpy.types.Object | None) -> float:
    """Return the camera spacing of an array as a fraction of the display's own; 1 without an array."""
    return float(array[SPACING]) if array else 1.0


def set_spacing(scene: bpy.types.Scene, fraction: float) -> None:
    """Set the camera spacing as a fraction of the display's own."""
    if (array := find(scene)) is not None:
        array[SPACING] = fraction
        array.update_tag()


def part_of_spacing(array: CameraArray, profile: DisplayProfile) -> float:
    """Return the camera spacing of a layout as a fraction of the display's own."""
    return array.spacing * profile.viewing_distance_mm / (profile.camera_spacing_mm * array.distance)


def placement(scene: bpy.types.Scene, profile: DisplayProfile) -> Placement | None:
    """Return the scene's camera array and its world matrix, None if it has none; LfsrError if it is broken."""
    return placed(array := find(scene), plane_of(array), profile)


def placed(array: bpy.types.Object | None, plane: bpy.types.Object | None, profile: DisplayProfile) -> Placement | None:
    """Return what ``placement`` does, of an array and its display plane that are known."""
    if array is None:
        return None
    if plane is None:
        raise LfsrError(f"camera array {array.name!r} has no display plane: remove it and add it again")
    if array.data.type != "PERSP":
        raise LfsrError(f"camera array {array.name!r} is of type {array.data.type}, but it must be a perspective "
                        "camera: set its lens type")
    matrix, distance = upright(array), distance_to(plane)
    if distance <= 0:
        raise LfsrError(f"the display plane of {array.name!r} lies behind the viewing position: move it in front")
    half_width = array.data.sensor_width / 2 / array.data.lens  # at distance 1
    cameras = CameraArray.for_display(profile, 2 * distance * half_width, distance)
    clip = array.data.clip_start, array.data.clip_end  # to which the scale of a camera does not apply
    return dataclasses.replace(cameras, spacing=cameras.spacing * spacing_of(array), clip=clip), from_blender(matrix)


def usable_depth(array: CameraArray, profile: DisplayProfile, scale: int = 1) -> tuple[float, float]:
    """Return the nearest and farthest usable distance from the viewing position, in scene units; may be infinite.

    As ``DisplayProfile.depth_range_mm``, for the array's own spacing and size: the disparity between
    neighbouring views is at most one lens pitch.
    """
    pitch = min(2 * array.half_width / profile.lenses[0], 2 * array.half_height / profile.lenses[1])
    spacing = array.spacing * scale
    behind = pitch * array.distance / (spacing - pitch) if spacing > pitch else math.inf
    return array.distance - pitch * array.distance / (spacing + pitch), array.distance + behind


def check_editable(data: bpy.types.ID) -> None:
    """Raise LfsrError if ``data`` cannot be changed in this file."""
    if reason := why_not_editable(data):
        raise LfsrError(reason)


def why_not_editable(data: bpy.types.ID) -> str | None:
    """Return why ``data`` cannot be changed in this file, None if it can."""
    if data.library is not None:
        return f"{data.name!r} is linked from {bpy.path.basename(data.library.filepath)}: make it local first"
    override = data.override_library
    if override is not None and override.is_system_override:
        return f"{data.name!r} is a library override that is not editable: make it editable or local first"
    return None


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


# The array as panels and 3D views draw it is found once, not at every move of the pointer: a search takes 20 ms among
# 50,000 objects. What was found stays until objects come or go. While Blender does not tell of changes (a render farm),
# each question searches.
Objects = list[bpy.types.Object]
_found: dict[int, tuple[Objects, Objects]] | None = None  # arrays and display planes of scenes by their ``session_uid``


def drawn(scene: bpy.types.Scene) -> tuple[bpy.types.Object | None, bpy.types.Object | None]:
    """Return what ``find`` and ``plane_of`` do, for drawing alone. Code that changes the scene must call those."""
    lists = {} if _found is None else _found
    for _ in range(2):
        if scene.session_uid not in lists:
            lists[scene.session_uid] = ([item for item in scene.objects if is_array(item)],
                                        [item for item in bpy.data.objects if PLANE in item])
        arrays, planes = lists[scene.session_uid]
        try:
            array = chosen(scene, arrays)
            return array, next((item for item in planes if array and item.parent == array and PLANE in item), None)
        except ReferenceError:  # one was removed, and no update came since
            lists.clear()
    return None, None


@bpy.app.handlers.persistent
def _forget(*_: object) -> None:
    if _found:
        _found.clear()


@bpy.app.handlers.persistent
def _changed(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Forget what was found where objects came, went or have another parent: that, too, tags collections."""
    if depsgraph.id_type_updated("COLLECTION"):
        _forget()


def register() -> None:
    """Keep what is found, since changes are told from now on."""
    global _found
    _found = {}


def unregister() -> None:
    """Search at every question again."""
    global _found
    _found = None


# An undo, a redo and the loading of a file replace Blender's data.
HANDLERS = (("depsgraph_update_post", _changed), *((f"{event}_{when}", _forget) for event in ("undo", "redo", "load")
                                                   for when in ("pre", "post")))
