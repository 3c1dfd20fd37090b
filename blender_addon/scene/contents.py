"""What a scene holds: its subject and background, collections, materials, and what a light field leaves out of it."""

from collections.abc import Iterable, Iterator
from itertools import combinations

import bpy

from lfsr_core.base.messages import LfsrError, Notice

from .. import compat
from .array import rig

BACKGROUND_COLLECTION = "Background"
GEOMETRY = {"MESH", "CURVE", "SURFACE", "FONT", "META", "VOLUME", "CURVES", "POINTCLOUD"}
# Nodes of a compositor: its output in 4.5 and since 5.0, and those that pass an image on as it is.
COMPOSITOR_OUTPUTS = {"CompositorNodeComposite", "NodeGroupOutput"}
PASSIVE_NODES = {*COMPOSITOR_OUTPUTS, "CompositorNodeRLayers", "NodeReroute"}
# What a view layer can do with a collection.
SWITCHES = ("exclude", "holdout", "indirect_only")
EEVEE_NODES = ("SHADERTORGB", "EEVEE_SPECULAR")  # which Cycles does not have
STROKES = {"GREASEPENCIL", "GPENCIL"}  # drawn over Blender's own render, since 4.3 and before
SHOWN = {*GEOMETRY, "LIGHT"}
OBLIQUE = 1e-3  # cosine between two axes of a camera


def find_subject(scene: bpy.types.Scene, name: str | None = None) -> set[bpy.types.Object]:
    """Return the objects of the collection ``name``; without a name, all objects outside the collection Background.

    LfsrError if there is no such collection or if none of its geometry would be rendered.
    """
    if not any(item.type in GEOMETRY or item.instance_type == "COLLECTION" for item in scene.objects):
        full = [repr(other.name) for other in bpy.data.scenes if any(item.type in GEOMETRY for item in other.objects)]
        raise LfsrError(f"scene {scene.name!r} is empty: add or import an object to render"
                        f"{f', or choose scene {full[0]}' if full else ''}")
    if name:
        collections = {c.name: c for c in (scene.collection, *scene.collection.children_recursive)}
        if name not in collections:
            raise LfsrError(f"the scene has no collection {name!r} for the subject: choose one of "
                            f"{', '.join(sorted(collections))}")
        chosen = set(collections[name].all_objects)
    else:
        # Linked files may have collections of the same name.
        backgrounds = (collection for collection in bpy.data.collections if collection.name == BACKGROUND_COLLECTION)
        chosen = set(scene.objects) - {item for background in backgrounds for item in background.all_objects}
    subject = with_instanced(chosen)
    if not any(item.type in GEOMETRY for item in subject & rendered(scene)):
        raise LfsrError(f"nothing of the subject {name or scene.name!r} would be rendered: "
                        "make its objects visible in renders or choose another collection")
    return subject


def has_background_meshes(scene: bpy.types.Scene, subject: set[bpy.types.Object]) -> bool:
    """Return True if geometry outside the subject would be rendered."""
    return any(item.type in GEOMETRY for item in rendered(scene) - subject)


def collections(root: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    """Yield the collections inside ``root``, at any depth."""
    for child in root.children:
        yield child
        yield from collections(child)


def with_instanced(items: set[bpy.types.Object]) -> set[bpy.types.Object]:
    """Return ``items`` and the objects that collection instances among them show, which may lie outside the scene."""
    shown, waiting, done = set(items), list(items), set[bpy.types.Collection | None]({None})
    while waiting:
        item = waiting.pop()
        if item.instance_type == "COLLECTION" and item.instance_collection not in done:
            done.add(item.instance_collection)
            waiting += (inside := _switched_on([item.instance_collection]) - shown)
            shown |= inside
    return shown


def rendered(scene: bpy.types.Scene) -> set[bpy.types.Object]:
    """Return the objects that renders of the scene show, those in instances of collections, too."""
    return with_instanced(_switched_on([scene.collection]))


def with_copied(items: set[bpy.types.Object]) -> set[bpy.types.Object]:
    """Return ``with_instanced`` and what geometry nodes and particles of these copy, whose collections may be off."""
    shown = with_instanced(items)
    if any(modifier.type in ("NODES", "PARTICLE_SYSTEM") for item in shown for modifier in item.modifiers):
        instances = bpy.context.evaluated_depsgraph_get().object_instances
        shown |= {copy.object.original for copy in instances if copy.is_instance and copy.parent.original in shown}
    return shown


def _switched_on(waiting: list[bpy.types.Collection]) -> set[bpy.types.Object]:
    """Objects that renders show of some collections: what is inside one that is switched off is off, too."""
    shown = set[bpy.types.Object]()
    while waiting:
        if not (collection := waiting.pop()).hide_render:
            shown |= {item for item in collection.objects if not item.hide_render}
            waiting += collection.children
    return shown


def shows(material: bpy.types.Material) -> bool:
    """Return False if all shaders of a material are Principled ones with Alpha 0."""
    shaders = [node for node in nodes_of(material.node_tree) if any(out.type == "SHADER" for out in node.outputs)]
    return not shaders or any(node.type != "BSDF_PRINCIPLED" or node.inputs["Alpha"].is_linked
                              or node.inputs["Alpha"].default_value for node in shaders)


def left_out(scene: bpy.types.Scene) -> list[Notice]:
    """Return what renders leave out or ignore of the scene."""
    notes = []
    if bpy.app.autoexec_fail:
        notes.append(Notice("scripts-off", {"reason": bpy.app.autoexec_fail_message.strip()}))
    render, cycles = scene.render, getattr(scene, "cycles", None)
    if render.engine != "CYCLES":
        notes.append(Notice("engine-ignored", {"engine": render.engine.removeprefix("BLENDER_").removesuffix("_NEXT")}))
    for material in materials(scene):
        nodes = list(nodes_of(material.node_tree))
        outputs = [node for node in nodes if node.type == "OUTPUT_MATERIAL"]
        of_eevee = outputs if {node.target for node in outputs} == {"EEVEE"} else []
        needed = leading([material.node_tree and material.node_tree.get_output_node("CYCLES")], True)
        for node in [*of_eevee, *(node for node in nodes if node.type in EEVEE_NODES and node in needed)][:1]:
            notes.append(Notice("eevee-nodes", {"material": material.name, "node": node.label or node.name}))
        if not shows(material):
            notes.append(Notice("material-clear", {"material": material.name}))
    settings = cycles.bl_rna.properties if cycles is not None else {}
    if cycles is not None and cycles.pixel_filter_type not in ("BOX", settings["pixel_filter_type"].default):
        notes.append(Notice("filter-ignored", {"filter": cycles.pixel_filter_type.replace("_", "-").lower()}))
    clamps = {name: getattr(cycles, f"sample_clamp_{name}") for name in ("direct", "indirect")} if cycles else {}
    if any(value != settings[f"sample_clamp_{name}"].default for name, value in clamps.items()):
        notes.append(Notice("clamp-ignored", clamps))
    notes += [Notice("motion-ignored")] if render.use_motion_blur else []
    notes += [Notice("border-ignored")] if render.use_border else []
    if render.pixel_aspect_x != render.pixel_aspect_y:
        notes.append(Notice("aspect-ignored", {"x": render.pixel_aspect_x, "y": render.pixel_aspect_y}))
    switches = (("use_curve_mapping", "curves"), ("use_white_balance", "white balance"))
    if names := [name for switch, name in switches if getattr(scene.view_settings, switch)]:
        notes.append(Notice("view-ignored", {"names": names}))
    lines = [item.name for item in rendered(scene) if item.type in STROKES]
    if names := [*(["Freestyle"] if render.use_freestyle else []), *sorted(lines)]:
        notes.append(Notice("lines-left-out", {"names": names}))
    if names := sorted(owner.name for owner in (*bpy.data.materials, scene.world)
                       if owner and owner.users and has_coordinates(owner.node_tree, ("Window",))):
        notes.append(Notice("coordinates-differ", {"names": names}))
    if scene.world is not None and any(
            node.type == "BACKGROUND" and not node.inputs["Strength"].is_linked
            and node.inputs["Strength"].default_value < 0 for node in nodes_of(scene.world.node_tree)):
        notes.append(Notice("world-negative", {"world": scene.world.name}))
    camera = scene.camera if scene.camera is not None and scene.camera.type == "CAMERA" else None
    if camera is not None:
        named, move = {"camera": camera.name}, {"x": camera.data.shift_x, "y": camera.data.shift_y}
        notes += [Notice("focus-ignored", named)] if camera.data.dof.use_dof else []
        axes = combinations(camera.matrix_world.normalized().to_3x3().col, 2)  # scales of parents make them oblique
        notes += [Notice("camera-sheared", named)] if any(abs(one.dot(other)) > OBLIQUE for one, other in axes) else []
        notes += [Notice("camera-parallel", named)] if camera.data.type == "ORTHO" else []
        notes += [Notice("shift-followed", named | move)] if camera.data.type == "PERSP" and any(move.values()) else []
    cameras = {marker.camera.name for marker in scene.timeline_markers if marker.camera is not None}
    notes += [Notice("markers-ignored", {"names": sorted(cameras)})] if len(cameras) > 1 and rig.find(scene) else []
    layer = rendered_layer(scene)
    if layer.material_override is not None:
        notes.append(Notice("override-ignored", {"layer": layer.name, "material": layer.material_override.name}))
    if getattr(layer, "world_override", None) is not None:
        notes.append(Notice("world-override-ignored", {"layer": layer.name, "world": layer.world_override.name}))
    for switch in SWITCHES:
        if names := sorted(child.name for child in switched(layer, switch)):
            notes.append(Notice("collections-switched", {"layer": layer.name, "switch": switch, "names": names}))
    if others := [other.name for other in scene.view_layers if other.use and other != layer]:
        notes.append(Notice("layers-left-out", {"layer": layer.name, "names": others}))
    tree = compat.compositor(scene)
    ends = [node for node in tree.nodes if node.bl_idname in COMPOSITOR_OUTPUTS] if tree is not None else []
    if nodes := sorted(node.label or node.name for node in leading(ends)
                       if node.bl_idname not in PASSIVE_NODES and not node.mute):
        notes.append(Notice("compositor-ignored", {"names": nodes}))
    editor = scene.sequence_editor if scene.render.use_sequencer else None
    if editor is not None and any(strip.type != "SOUND" and not strip.mute for strip in editor.strips):
        notes.append(Notice("sequencer-ignored"))
    return notes


def materials(scene: bpy.types.Scene) -> list[bpy.types.Material]:
    """Return the materials of objects that are rendered, by name."""
    slots = (slot.material for item in with_copied(rendered(scene)) for slot in item.material_slots)
    return sorted(set(filter(None, slots)), key=lambda material: material.name)


def has_output(scene: bpy.types.Scene, name: str) -> bool:
    """Return True if a rendered material uses this output: "Volume", or "Displacement" that moves the surface."""
    used = [material.node_tree.get_output_node("CYCLES") for material in materials(scene) if material.node_tree
            and (name == "Volume" or material.displacement_method != "BUMP")]
    return any(node.inputs[name].is_linked for node in used if node is not None)


def nodes_of(tree: bpy.types.NodeTree | None) -> Iterator[bpy.types.Node]:
    """Yield the nodes of a shader's tree and of the groups in it that are not muted."""
    for node in tree.nodes if tree is not None else ():
        if not node.mute:
            yield node
            if node.type == "GROUP":
                yield from nodes_of(node.node_tree)


def leading(ends: Iterable[bpy.types.Node | None], enters: bool = False) -> set[bpy.types.Node]:
    """Return ``ends`` and the nodes from which links lead to them, those inside groups if it ``enters`` these."""
    passed, waiting = set[bpy.types.Node](), [*filter(None, ends)]
    while waiting:
        if (node := waiting.pop()) not in passed:
            passed.add(node)
            waiting += [link.from_node for socket in node.inputs for link in socket.links]
            if enters and node.type == "GROUP" and node.node_tree is not None:
                waiting += [end for end in node.node_tree.nodes if end.type == "GROUP_OUTPUT"]
    return passed


def has_coordinates(tree: bpy.types.NodeTree | None, names: Iterable[str]) -> bool:
    """Return True if a shader uses texture coordinates of these names."""
    return any(node.bl_idname == "ShaderNodeTexCoord" and node.outputs[name].is_linked
               for node in nodes_of(tree) for name in names)


def rendered_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    """Return the first view layer that is used for rendering, the one that is rendered."""
    return next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])


def switched(layer: bpy.types.ViewLayer, switch: str) -> list[bpy.types.LayerCollection]:
    """Return the collections of ``layer`` with geometry or lights that have one of SWITCHES on.

    So excluded collections of helpers that importers leave behind do not count.
    """
    return [child for child in collections(layer.layer_collection) if getattr(child, switch) and any(
        item.type in SHOWN and not item.hide_render for item in child.collection.all_objects)]


def curves(owner: bpy.types.ID) -> Iterator[bpy.types.FCurve]:
    """Yield the curves of drivers, of the action, and of the strips of the nonlinear animation of ``owner``."""
    if (animation := owner.animation_data) is None:
        return
    yield from animation.drivers
    for holder in (animation, *(strip for track in animation.nla_tracks for strip in track.strips)):
        if holder.action is not None and holder.action_slot is not None:
            bags = (strip.channelbag(holder.action_slot) for layer in holder.action.layers for strip in layer.strips)
            yield from (curve for bag in bags if bag is not None for curve in bag.fcurves)
