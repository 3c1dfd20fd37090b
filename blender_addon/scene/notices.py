"""Notices for the user before a render: settings of the scene that a light field does not honour."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from lfsr_core.base.notices import Notice

from .. import compat

# Nodes of a compositor: its output in 4.5 and since 5.0, and those that pass an image on as it is.
COMPOSITOR_OUTPUTS = {"CompositorNodeComposite", "NodeGroupOutput"}
PASSIVE_NODES = {*COMPOSITOR_OUTPUTS, "CompositorNodeRLayers", "NodeReroute"}
# What a view layer can do with a collection.
SWITCHES = ("exclude", "holdout", "indirect_only")
SHOWN = {"MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "VOLUME", "LIGHT"}


def left_out(scene: bpy.types.Scene) -> list[Notice]:
    """Return what renders leave out or ignore of the scene."""
    found = []
    if bpy.app.autoexec_fail:
        found.append(Notice("scripts-off", {"reason": bpy.app.autoexec_fail_message.strip()}))
    camera = scene.camera if scene.camera is not None and scene.camera.type == "CAMERA" else None
    if camera is not None and (camera.data.shift_x or camera.data.shift_y):
        found.append(Notice("shift-ignored", {"camera": camera.name, "x": camera.data.shift_x,
                                              "y": camera.data.shift_y}))
    layer = rendered_layer(scene)
    if layer.material_override is not None:
        found.append(Notice("override-ignored", {"layer": layer.name, "material": layer.material_override.name}))
    for switch in SWITCHES:
        if names := sorted(child.name for child in switched(layer, switch)):
            found.append(Notice("collections-switched", {"layer": layer.name, "switch": switch, "names": names}))
    if others := [other.name for other in scene.view_layers if other.use and other != layer]:
        found.append(Notice("layers-left-out", {"layer": layer.name, "names": others}))
    if nodes := _effects(compat.compositor(scene)):
        found.append(Notice("compositor-ignored", {"names": nodes}))
    editor = scene.sequence_editor if scene.render.use_sequencer else None
    if editor is not None and any(strip.type != "SOUND" and not strip.mute for strip in editor.strips):
        found.append(Notice("sequencer-ignored"))
    return found


def rendered_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    """Return the first view layer that is used for rendering, the one that passes.py takes."""
    return next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])


def switched(layer: bpy.types.ViewLayer, switch: str) -> list[bpy.types.LayerCollection]:
    """Return the collections of ``layer`` with geometry or lights that have one of SWITCHES on."""
    return [child for child in _collections(layer.layer_collection)
            if getattr(child, switch) and _shows_anything(child.collection)]


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


def _shows_anything(collection: bpy.types.Collection) -> bool:
    """False for the excluded collections of helpers that importers leave behind."""
    return any(item.type in SHOWN and not item.hide_render for item in collection.all_objects)


def _collections(root: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    for child in root.children:
        yield child
        yield from _collections(child)
