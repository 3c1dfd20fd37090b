"""The camera array as panels and 3D views draw it: found once, not at every move of the pointer.

A search takes 20 ms among 50,000 objects. What was found stays until objects come or go. Whoever changes the scene asks
``rig``, which always searches, and so does this module while Blender does not tell it of changes (a render farm).
"""

from __future__ import annotations

import bpy

from lfsr_core.optics.display import DisplayProfile

from . import rig

Objects = list[bpy.types.Object]
_found: dict[int, tuple[Objects, Objects]] | None = None  # arrays and display planes of scenes by their ``session_uid``


def find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return what ``rig.find`` does."""
    return array_and_plane(scene)[0]


def array_and_plane(scene: bpy.types.Scene) -> tuple[bpy.types.Object | None, bpy.types.Object | None]:
    """Return what ``rig.find`` and ``rig.plane_of`` do."""
    try:
        return _chosen(scene, *_objects(scene))
    except ReferenceError:  # one was removed, and no update came since
        _forget()
        return _chosen(scene, *_objects(scene))


def placement(scene: bpy.types.Scene, profile: DisplayProfile) -> rig.Placement | None:
    """Return what ``rig.placement`` does; errors as there."""
    return rig.placed(*array_and_plane(scene), profile)


def distance(scene: bpy.types.Scene) -> float:
    """Return the distance from the viewing position to the display plane in scene units; 0 without an array."""
    return rig.distance_to(array_and_plane(scene)[1])


def spacing(scene: bpy.types.Scene) -> float:
    """Return the camera spacing as a fraction of the display's own; 1 without an array."""
    return rig.spacing_of(find(scene))


def _chosen(scene: bpy.types.Scene, arrays: Objects,
            planes: Objects) -> tuple[bpy.types.Object | None, bpy.types.Object | None]:
    array = rig.chosen(scene, arrays)
    return array, next((item for item in planes if array and item.parent == array and rig.PLANE in item), None)


def _objects(scene: bpy.types.Scene) -> tuple[Objects, Objects]:
    if _found is None:
        return _search(scene)
    if scene.session_uid not in _found:
        _found[scene.session_uid] = _search(scene)
    return _found[scene.session_uid]


def _search(scene: bpy.types.Scene) -> tuple[Objects, Objects]:
    return ([item for item in scene.objects if rig.is_array(item)],
            [item for item in bpy.data.objects if rig.PLANE in item])


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


# Blender's own data are other ones after an undo, a redo or another file.
HANDLERS = (("depsgraph_update_post", _changed), *((f"{event}_{when}", _forget) for event in ("undo", "redo", "load")
                                                   for when in ("pre", "post")))
