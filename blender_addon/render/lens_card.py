"""The lens card in Blender: an orthographic camera, the card before it, and the material that sends its rays on.

The card's material is nothing but a Ray Portal BSDF, so it runs on every device that Cycles has. Both stand at
the array's origin, the card less than ``GAP`` behind the camera plane, on which the portals end; nothing but
the camera sees it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import mathutils
import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.lens_card import LensCard, lens_card
from lfsr_core.optics.rays import RayLayout

from .. import compat
from ..array.spaces import Matrix, to_blender
from ..scene.volumes import distance_to_volume
from .overrides import overridden

NAME = "LFSR Lens Card"
CELL, LENS = "cell", "lens"   # attributes of the mesh
GAP = 1e-4                    # from the camera to the camera plane, as a share of the display distance
# Before the card the camera sees this much, as a share of the distance to the world's origin: what single precision
# needs there, and no more, since a surface of the scene that passes through is seen instead of the card.
CLEAR = 4e-6
LEAST_CLEAR = 1e-6            # scene units: Blender clips nothing nearer
# Half the side of the square that the camera's own aperture shows, as a share of its distance to the card: small, so
# that rays meet the card within their pixel, and large enough for single precision.
SLANT = 2e-3
_VISIBILITY = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")


@dataclasses.dataclass(frozen=True)
class Place:
    """Where things stand along the array's axis, in scene units."""

    # From the camera to the camera plane; the card is half way.
    gap: float
    # How much the camera sees before the card.
    clear: float
    # Where rays start, as a share of the way from the camera plane to the display plane.
    start: float


@contextmanager
def card_camera(scene: bpy.types.Scene, layout: RayLayout, matrix_world: Matrix,
                clip_start: float = 0.0) -> Iterator[bpy.types.Object]:
    """Inside the block the scene's camera looks at the card of ``layout``; its rays start at the depth ``clip_start``.

    Nothing of both is left after it.
    """
    frame = to_blender(matrix_world)
    # Cycles asks at the card which volumes a path begins in.
    card = lens_card(layout, distance_to_volume(scene, frame.translation))
    place = place_of(layout, frame.translation.length, clip_start)
    made: list[bpy.types.ID] = []
    try:
        camera = new_camera(made, card, layout, place)
        screen = new_card(made, card, layout.array.distance, place)
        for item, behind in ((camera, place.gap), (screen, place.gap / 2)):
            item.matrix_world = frame @ mathutils.Matrix.Translation((0, 0, behind))
            scene.collection.objects.link(item)
        # The card is one more surface that a path passes through.
        with (overridden(scene, {"camera": camera}), overridden(
                scene.cycles, {"transparent_max_bounces": scene.cycles.transparent_max_bounces + 1})):
            yield camera
    finally:
        bpy.data.batch_remove(made)


def place_of(layout: RayLayout, far: float, clip_start: float = 0.0) -> Place:
    """Where things stand for an array ``far`` from the world's origin whose rays start at the depth ``clip_start``."""
    clear = max(CLEAR * max(far, layout.array.distance), LEAST_CLEAR)
    return Place(max(GAP * layout.array.distance, 4 * clear), clear, clip_start / layout.array.distance)


def without_misses(position: Array, matrix_world: Matrix) -> Array:
    """Position layer (H, W, 3) with 0 where a ray hit nothing: Cycles leaves the card's own place there.

    What a ray hits lies before the camera plane, the card behind it.
    """
    place = np.asarray(matrix_world, float)
    depth = (position - place[:3, 3]) @ place[:3, 2]
    return np.where((depth > 0)[..., None], position, np.float32(0))


def new_camera(made: list[bpy.types.ID], card: LensCard, layout: RayLayout, place: Place) -> bpy.types.Object:
    """The camera, in no scene and at no place yet; it and its data are added to ``made``."""
    data = bpy.data.cameras.new(NAME)
    camera = bpy.data.objects.new(NAME, data)
    made += [data, camera]
    data.type, data.sensor_fit = "ORTHO", "HORIZONTAL"
    data.ortho_scale = layout.size[0] * card.pixel
    data.clip_start, data.clip_end = place.gap / 2 - place.clear, place.gap
    data.dof.use_dof = any(card.aperture)
    data.dof.focus_object, data.dof.focus_distance = None, place.gap / 2
    data.dof.aperture_blades, data.dof.aperture_rotation, data.dof.aperture_ratio = 4, 0.0, 1.0
    # An orthographic camera's aperture has the radius 1 / (2 · f-stop); a square's corners lie on it.
    data.dof.aperture_fstop = 1 / (2 * math.sqrt(2) * SLANT * place.gap / 2)
    return camera


def new_card(made: list[bpy.types.ID], card: LensCard, distance: float, place: Place) -> bpy.types.Object:
    """The card, as ``new_camera``; ``distance`` is the display plane's."""
    mesh = bpy.data.meshes.new(NAME)
    screen = bpy.data.objects.new(NAME, mesh)
    made += [mesh, screen]
    _fill(mesh, card, distance + place.gap)
    mesh.materials.append(_material(made, card, place))
    for kind in _VISIBILITY:
        setattr(screen, f"visible_{kind}", False)
    return screen


def _fill(mesh: bpy.types.Mesh, card: LensCard, depth: float) -> None:
    """One quad per tile, with its attributes; ``depth`` is the display plane's in the camera's space."""
    count = len(card.corners)
    mesh.vertices.add(4 * count)
    mesh.loops.add(4 * count)
    mesh.polygons.add(count)
    flat = _with_z(card.corners.reshape(-1, 2), 0.0)
    mesh.vertices.foreach_set("co", flat)
    mesh.loops.foreach_set("vertex_index", range(4 * count))
    mesh.polygons.foreach_set("loop_start", range(0, 4 * count, 4))
    mesh.attributes.new(CELL, "FLOAT2", "CORNER").data.foreach_set("vector", card.cells.astype("f4").ravel())
    mesh.attributes.new(LENS, "FLOAT_VECTOR", "FACE").data.foreach_set("vector", _with_z(card.targets, depth))
    mesh.update(calc_edges=True)


def _with_z(points: Array, z: float) -> Array:
    return np.column_stack([points, np.full(len(points), z)]).astype("f4").ravel()


def _material(made: list[bpy.types.ID], card: LensCard, place: Place) -> bpy.types.Material:
    group = ray_group(card.place_in_pixel)
    material = bpy.data.materials.new(NAME)
    made += [group, material]
    compat.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    rays, portal, output = (tree.nodes.new(kind) for kind in (
        "ShaderNodeGroup", "ShaderNodeBsdfRayPortal", "ShaderNodeOutputMaterial"))
    rays.node_tree, rays.label = group, "Ray of this pixel"
    # Incoming spans ± SLANT, which stands for ± half the cell.
    spread = [side / (2 * SLANT) for side in card.aperture]
    for name, value in (("Lens Step", (*card.lens_step, 0)), ("First View", (*card.first_view, place.gap)),
                        ("View Step", (*card.view_step, 0)), ("Aperture", (*spread, 0)),
                        ("Start", (place.start,) * 3)):
        rays.inputs[name].default_value = value
    for name in ("Position", "Direction"):
        tree.links.new(rays.outputs[name], portal.inputs[name])
    tree.links.new(portal.outputs[0], output.inputs["Surface"])
    for number, node in enumerate((rays, portal, output)):
        node.location = (200 * number, 0)
    return material


def ray_group(place_in_pixel: bool) -> bpy.types.NodeTree:
    """Node group of ``lfsr_core.optics.lens_card.card_rays``: from the card's attributes to a world-space ray."""
    tree = bpy.data.node_groups.new(NAME, "ShaderNodeTree")
    for name in ("Lens Step", "First View", "View Step", "Aperture", "Start"):
        tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketVector")
    for name in ("Position", "Direction"):
        tree.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketVector")
    return _Wiring(tree).ray(place_in_pixel)


class _Wiring:
    """Adds nodes to a tree, one column to the right each."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self.constants = self.node("NodeGroupInput").outputs

    def ray(self, place_in_pixel: bool) -> bpy.types.NodeTree:
        cells, lens = self.uv_map(CELL), self.attribute(LENS)
        view = self.math("FLOOR", cells)
        place = self.math("FRACTION", cells) if place_in_pixel else cells
        slant = self.transform(self.node("ShaderNodeNewGeometry").outputs["Incoming"], "VECTOR", "WORLD", "CAMERA")
        centre = self.math("MULTIPLY_ADD", view, self.constants["View Step"], self.constants["First View"])
        start = self.math("MULTIPLY_ADD", slant, self.constants["Aperture"], centre)
        end = self.math("MULTIPLY_ADD", place, self.constants["Lens Step"], lens)
        output = self.node("NodeGroupOutput").inputs
        way = self.math("SUBTRACT", end, start)
        begin = self.math("MULTIPLY_ADD", way, self.constants["Start"], start)
        self.tree.links.new(self.transform(begin, "POINT", "CAMERA", "WORLD"), output["Position"])
        # As a normal the direction comes out with length 1, which Cycles needs before 5.2.
        self.tree.links.new(self.transform(way, "NORMAL", "CAMERA", "WORLD"), output["Direction"])
        return self.tree

    def node(self, kind: str) -> bpy.types.Node:
        node = self.tree.nodes.new(kind)
        node.location = (180 * len(self.tree.nodes), 0)
        return node

    def uv_map(self, name: str) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeUVMap")
        node.uv_map = name
        return node.outputs["UV"]

    def attribute(self, name: str) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeAttribute")
        node.attribute_name = name
        return node.outputs["Vector"]

    def math(self, operation: str, *inputs: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeVectorMath")
        node.operation = operation
        for socket, value in zip(node.inputs, inputs, strict=False):
            self.tree.links.new(value, socket)
        return node.outputs["Vector"]

    def transform(self, vector: bpy.types.NodeSocket, kind: str, of: str, to: str) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeVectorTransform")
        node.vector_type, node.convert_from, node.convert_to = kind, of, to
        self.tree.links.new(vector, node.inputs["Vector"])
        return node.outputs["Vector"]
