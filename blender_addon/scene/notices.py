"""What a user should know before a render: files that are not there, settings that it does not honour."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy

SHOWN = {"MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "VOLUME", "LIGHT"}


def notices(scene: bpy.types.Scene) -> list[str]:
    """A sentence each; none of them stops the render."""
    return [*_missing_files(), *_disabled_drivers(), *_camera(scene), *_view_layer(scene)]


def missing_images() -> list[str]:
    """Paths of image files that the scene names and that are not there, every tile of a UDIM image on its own."""
    return sorted(str(path) for path in image_files() if not path.is_file())


def image_files() -> set[Path]:
    """Files that images are read from, every tile of a UDIM image on its own."""
    images = [image for image in bpy.data.images if image.filepath and not image.packed_file]
    return {path for image in images for path in _paths(image)}


def _paths(image: bpy.types.Image) -> Iterator[Path]:
    """Every file that ``image`` is read from."""
    named = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "FILE":
        yield Path(named)
    elif image.source == "TILED":
        for tile in image.tiles:
            row, column = divmod(tile.number - 1001, 10)
            yield Path(named.replace("<UDIM>", str(tile.number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}"))


def _missing_files() -> Iterator[str]:
    missing = missing_images()
    if missing:
        yield f"{len(missing)} image files are missing, first {missing[0]}: what uses them renders magenta"
    libraries = [Path(bpy.path.abspath(library.filepath)) for library in bpy.data.libraries]
    lost = sorted(str(path) for path in libraries if not path.is_file())
    if lost:
        yield f"{len(lost)} linked files are missing, first {lost[0]}: what comes from them is not in the picture"


def _disabled_drivers() -> Iterator[str]:
    if bpy.app.autoexec_fail:
        yield (f"Python in this file was not run ({bpy.app.autoexec_fail_message.strip()}): what its drivers and "
               "scripts would move stands still")


def _camera(scene: bpy.types.Scene) -> Iterator[str]:
    data = scene.camera.data if scene.camera is not None and scene.camera.type == "CAMERA" else None
    if data is not None and (data.shift_x or data.shift_y):
        yield (f"the camera's shift ({data.shift_x:g}, {data.shift_y:g}) is not honoured: the array looks straight "
               "along the camera")


def _view_layer(scene: bpy.types.Scene) -> Iterator[str]:
    """Of the first view layer that renders, the one that passes.py takes."""
    layer = next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])
    if layer.material_override is not None:
        yield (f"view layer {layer.name!r} has the material override {layer.material_override.name!r}, which is not "
               "honoured: objects keep their own materials")
    switches = {"exclude": "excludes", "holdout": "holds out", "indirect_only": "makes indirect-only"}
    for switch, does in switches.items():
        names = [child.name for child in _collections(layer.layer_collection)
                 if getattr(child, switch) and _shows_anything(child.collection)]
        if names:
            yield f"view layer {layer.name!r} {does} {', '.join(sorted(names)[:3])}: so does this render"
    others = [other.name for other in scene.view_layers if other.use and other != layer]
    if others:
        yield f"only view layer {layer.name!r} is rendered, without {', '.join(others[:3])}"


def _shows_anything(collection: bpy.types.Collection) -> bool:
    """Importers leave excluded collections of helpers behind, which are no news."""
    return any(item.type in SHOWN and not item.hide_render for item in collection.all_objects)


def _collections(root: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    for child in root.children:
        yield child
        yield from _collections(child)
