"""Tell a scene's subject from its background; the collections of a view layer."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from lfsr_core.base.messages import LfsrError

BACKGROUND_COLLECTION = "Background"
GEOMETRY = {"MESH", "CURVE", "SURFACE", "FONT", "META", "VOLUME", "CURVES", "POINTCLOUD"}


def find_subject(scene: bpy.types.Scene, name: str | None = None) -> set[bpy.types.Object]:
    """Return the objects of the collection ``name``; without a name, all objects outside the collection Background.

    LfsrError if there is no such collection or if none of its geometry would be rendered.
    """
    if not any(item.type in GEOMETRY or item.instance_type == "COLLECTION" for item in scene.objects):
        raise LfsrError(f"scene {scene.name!r} is empty: add or import an object to render")
    if name:
        collections = {c.name: c for c in (scene.collection, *scene.collection.children_recursive)}
        if name not in collections:
            raise LfsrError(f"the scene has no collection {name!r} for the subject: choose one of "
                            f"{', '.join(sorted(collections))}")
        chosen = set(collections[name].all_objects)
    else:
        # Of several files, where some are linked.
        backgrounds = (found for found in bpy.data.collections if found.name == BACKGROUND_COLLECTION)
        chosen = set(scene.objects) - {item for background in backgrounds for item in background.all_objects}
    subject = with_instanced(chosen)
    if not any(item.type in GEOMETRY and _rendered(scene, item) for item in subject):
        raise LfsrError(f"nothing of the subject {name or scene.name!r} would be rendered: "
                        "make its objects visible in renders or choose another collection")
    return subject


def has_background_meshes(scene: bpy.types.Scene, subject: set[bpy.types.Object]) -> bool:
    """Return True if geometry outside the subject would be rendered."""
    return any(item.type in GEOMETRY and item not in subject and _rendered(scene, item) for item in scene.objects)


def collections(root: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    """Yield the collections inside ``root``, at any depth."""
    for child in root.children:
        yield child
        yield from collections(child)


def with_instanced(items: set[bpy.types.Object]) -> set[bpy.types.Object]:
    """Return ``items`` and the objects that collection instances among them show."""
    return items | {child for item in items for child in _instanced(item)}


def _instanced(item: bpy.types.Object) -> set[bpy.types.Object]:
    """Objects that a collection instance shows; they may lie outside the scene's collections."""
    if item.instance_type != "COLLECTION" or item.instance_collection is None:
        return set()
    inside = set(item.instance_collection.all_objects)
    return inside | {child for other in inside for child in _instanced(other)}


def _rendered(scene: bpy.types.Scene, item: bpy.types.Object) -> bool:
    owners = [c for c in (scene.collection, *scene.collection.children_recursive) if item.name in c.objects]
    return not item.hide_render and (not owners or any(not c.hide_render for c in owners))
