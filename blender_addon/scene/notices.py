"""Notices for the user before a render: missing files, and settings that are ignored."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import bpy

from .. import compat

# Nodes of a compositor: its output in 4.5 and since 5.0, and those that pass an image on as it is.
COMPOSITOR_OUTPUTS = {"CompositorNodeComposite", "NodeGroupOutput"}
PASSIVE_NODES = {*COMPOSITOR_OUTPUTS, "CompositorNodeRLayers", "NodeReroute"}
MOST_NAMES = 3
# What a view layer can do with a collection: a title, and the words for it.
SWITCHES = {"exclude": ("Excluded Collections", "excludes"), "holdout": ("Holdouts", "holds out"),
            "indirect_only": ("Indirect-Only Collections", "makes indirect-only")}
SHOWN = {"MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "VOLUME", "LIGHT"}


@dataclasses.dataclass(frozen=True)
class Notice:
    """Something that a render leaves out or ignores."""

    code: str  # its kind
    title: str  # what it is, in a word or two
    sentence: str
    target: str = ""  # name of the camera or view layer


def notices(scene: bpy.types.Scene) -> list[str]:
    """Return a sentence for each thing that changes the image but does not stop the render."""
    return [*_missing("image", missing_images(), "renders magenta", "render magenta"),
            *(notice.sentence for notice in left_out(scene))]


def left_out(scene: bpy.types.Scene) -> list[Notice]:
    """Return each thing of the scene that renders leave out or ignore, but for missing images."""
    found = (_linked_files(), _disabled_drivers(), _camera(scene), _view_layer(scene), _compositor(scene),
             _sequencer(scene))
    return [notice for notices in found for notice in notices]


def missing_images() -> list[str]:
    """Return the paths of missing image files, with each tile of a UDIM image."""
    return sorted(str(path) for path in image_files() if not path.is_file())


def image_files() -> set[Path]:
    """Return the files that images are read from, with each tile of a UDIM image."""
    images = [image for image in bpy.data.images if image.filepath and not image.packed_file]
    return {path for image in images for path in _paths(image)}


def _paths(image: bpy.types.Image) -> Iterator[Path]:
    named = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "FILE":
        yield Path(named)
    elif image.source == "TILED":
        for tile in image.tiles:
            row, column = divmod(tile.number - 1001, 10)
            yield Path(named.replace("<UDIM>", str(tile.number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}"))


def _linked_files() -> Iterator[Notice]:
    libraries = [Path(bpy.path.abspath(library.filepath)) for library in bpy.data.libraries]
    linked = sorted(str(path) for path in libraries if not path.is_file())
    for sentence in _missing("linked", linked, "is left out", "are left out"):
        yield Notice("linked", "Linked Files", sentence)


def _missing(kind: str, paths: list[str], effect: str, effects: str) -> Iterator[str]:
    if len(paths) == 1:
        yield f"The {kind} file {paths[0]} is missing and {effect}"
    elif paths:
        yield f"{len(paths)} {kind} files are missing and {effects}, such as {paths[0]}"


def _disabled_drivers() -> Iterator[Notice]:
    if bpy.app.autoexec_fail:
        yield Notice("autoexec", "Scripts", "Blender did not run the Python in this file "
                     f"({bpy.app.autoexec_fail_message.strip()}), so its drivers and scripts move nothing")


def _camera(scene: bpy.types.Scene) -> Iterator[Notice]:
    data = scene.camera.data if scene.camera is not None and scene.camera.type == "CAMERA" else None
    if data is not None and (data.shift_x or data.shift_y):
        yield Notice("shift", "Camera Shift", f"The camera's shift ({data.shift_x:g}, {data.shift_y:g}) is ignored. "
                     "The array looks along the camera's axis", scene.camera.name)


def rendered_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    """Return the first view layer that is used for rendering, the one that passes.py takes."""
    return next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])


def _view_layer(scene: bpy.types.Scene) -> Iterator[Notice]:
    layer = rendered_layer(scene)
    if layer.material_override is not None:
        yield Notice("override", "Material Override", f"The material override {layer.material_override.name!r} of view "
                     f"layer {layer.name!r} is ignored. Objects keep their own materials", layer.name)
    for switch, (title, does) in SWITCHES.items():
        names = [child.name for child in switched(layer, switch)]
        if names:
            yield Notice(switch, title, f"View layer {layer.name!r} {does} {', '.join(sorted(names)[:MOST_NAMES])}, "
                         "and so does this render", layer.name)
    others = [other.name for other in scene.view_layers if other.use and other != layer]
    if others:
        yield Notice("layers", "View Layers", f"Only view layer {layer.name!r} is rendered, without "
                     f"{', '.join(others[:MOST_NAMES])}", layer.name)


def switched(layer: bpy.types.ViewLayer, switch: str) -> list[bpy.types.LayerCollection]:
    """Return the collections of ``layer`` with geometry or lights that have one of SWITCHES on."""
    return [child for child in _collections(layer.layer_collection)
            if getattr(child, switch) and _shows_anything(child.collection)]


def _compositor(scene: bpy.types.Scene) -> Iterator[Notice]:
    names = _effects(compat.compositor(scene))
    if names:
        yield Notice("compositor", "Compositor", f"Compositor nodes ({', '.join(names[:MOST_NAMES])}) are not applied "
                     "to the light field. Apply them to exported views")


def _effects(tree: bpy.types.NodeTree | None) -> list[str]:
    """Names of the nodes through which an image passes on its way to the compositor's output."""
    waiting = [node for node in tree.nodes if node.bl_idname in COMPOSITOR_OUTPUTS] if tree is not None else []
    passed: set[bpy.types.Node] = set()
    while waiting:
        node = waiting.pop()
        if node not in passed:
            passed.add(node)
            waiting += [link.from_node for socket in node.inputs for link in socket.links]
    return sorted(node.label or node.name for node in passed if node.bl_idname not in PASSIVE_NODES and not node.mute)


def _sequencer(scene: bpy.types.Scene) -> Iterator[Notice]:
    editor = scene.sequence_editor if scene.render.use_sequencer else None
    if editor is not None and any(strip.type != "SOUND" and not strip.mute for strip in editor.strips):
        yield Notice("sequencer", "Sequencer", "The sequencer's strips are not rendered. The light field shows the "
                     "scene itself")


def _shows_anything(collection: bpy.types.Collection) -> bool:
    """False for the excluded collections of helpers that importers leave behind."""
    return any(item.type in SHOWN and not item.hide_render for item in collection.all_objects)


def _collections(root: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    for child in root.children:
        yield child
        yield from _collections(child)
