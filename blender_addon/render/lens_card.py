"""The lens card in Blender: an orthographic camera, and a card in front of it whose material redirects its rays.

The material is a Ray Portal BSDF, so it runs on every device. Both stand just behind the camera plane, on which the
portals end.
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

from ..array.spaces import Matrix, to_blender
from ..scene.volumes import distance_to_volume
from .overrides import new_data, overridden
from .wiring import Wiring, new_screen

NAME = "LFSR Lens Card"
CELL, LENS = "cell", "lens"   # attributes of the mesh
GAP = 1e-4                    # from the camera to the camera plane, as a fraction of the display distance
# What the camera sees in front of the card, as a fraction of the distance to the world's origin: no more than single
# precision needs, since a surface there would be seen instead of the card.
CLEAR = 4e-6
LEAST_CLEAR = 1e-6            # scene units: Blender clips nothing nearer
# Half the side of the square of the camera's own aperture, as a fraction of its distance to the card: small enough
# for rays to meet the card within their pixel, and large enough for single precision.
SLANT = 2e-3


@dataclasses.dataclass(frozen=True)
class Place:
    """Places along the array's axis, in scene units."""

    gap: float  # from the camera to the camera plane; the card is half way
    clear: float  # what the camera sees in front of the card
    start: float  # where rays start, as a fraction of the way from the camera plane to the display plane


@contextmanager
def card_camera(scene: bpy.types.Scene, layout: RayLayout, matrix_world: Matrix,
                clip_start: float = 0.0) -> Iterator[bpy.types.Object]:
    """Make a camera with the card of ``layout`` the scene's camera inside the block; rays start at ``clip_start``."""
    frame = to_blender(matrix_world)
    # Cycles asks at the card which volumes a path begins in.
    card = lens_card(layout, distance_to_volume(scene, frame.translation))
    place = place_of(layout, frame.translation.length, clip_start)
    with new_data() as made:
        camera = new_camera(made, card, layout, place)
        screen = new_card(made, card, layout.array.distance, place)
        for item, behind in ((camera, place.gap), (screen, place.gap / 2)):
            item.matrix_world = frame @ mathutils.Matrix.Translation((0, 0, behind))
            scene.collection.objects.link(item)
        # The card is one more surface that a path passes through.
        with (overridden(scene, {"camera": camera}), overridden(
                scene.cycles, {"transparent_max_bounces": scene.cycles.transparent_max_bounces + 1})):
            yield camera


def place_of(layout: RayLayout, far: float, clip_start: float = 0.0) -> Place:
    """Return the places for an array at the distance ``far`` from the world's origin, with rays from ``clip_start``."""
    clear = max(CLEAR * max(far, layout.array.distance), LEAST_CLEAR)
    return Place(max(GAP * layout.array.distance, 4 * clear), clear, clip_start / layout.array.distance)


def new_camera(made: list[bpy.types.ID], card: LensCard, layout: RayLayout, place: Place) -> bpy.types.Object:
    """Return the camera, in no scene and not placed; it and its data are added to ``made``."""
    data = bpy.data.cameras.new(NAME)
    camera = bpy.data.objects.new(NAME, data)
    made += [data, camera]
    data.type, data.sensor_fit = "ORTHO", "HORIZONTAL"
    data.ortho_scale = layout.size[0] * card.pixel
    data.clip_start, data.clip_end = place.gap / 2 - place.clear, place.gap
    data.dof.use_dof = any(card.aperture)
    data.dof.focus_object, data.dof.focus_distance = None, place.gap / 2
    data.dof.aperture_blades, data.dof.aperture_rotation, data.dof.aperture_ratio = 4, 0.0, 1.0
    # An orthographic camera's aperture has the radius 1 / (2 · f-stop); the corners of a square lie on it.
    data.dof.aperture_fstop = 1 / (2 * math.sqrt(2) * SLANT * place.gap / 2)
    return camera


def new_card(made: list[bpy.types.ID], card: LensCard, distance: float, place: Place) -> bpy.types.Object:
    """Return the card, as ``new_camera``; ``distance`` is the display plane's."""
    def ray(wiring: Wiring) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]:
        group = ray_group(card.place_in_pixel)
        made.append(group)
        rays = wiring.node("ShaderNodeGroup")
        rays.node_tree, rays.label = group, "Ray of this pixel"
        # Incoming spans ± SLANT, which stands for ± half the cell.
        spread = [side / (2 * SLANT) for side in card.aperture]
        for name, value in (("Lens Step", (*card.lens_step, 0)), ("First View", (*card.first_view, place.gap)),
                            ("View Step", (*card.view_step, 0)), ("Aperture", (*spread, 0)),
                            ("Start", (place.start,) * 3)):
            rays.inputs[name].default_value = value
        return rays.outputs["Position"], rays.outputs["Direction"]

    screen = new_screen(made, NAME, ray)
    _fill(screen.data, card, distance + place.gap)
    return screen


def _fill(mesh: bpy.types.Mesh, card: LensCard, depth: float) -> None:
    """Add a quad with its attributes for each tile; ``depth``: of the display plane in the camera's space."""
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


def ray_group(place_in_pixel: bool) -> bpy.types.NodeTree:
    """Return the node group of ``lfsr_core.optics.lens_card.card_rays``: the card's attributes -> a world-space ray."""
    tree = bpy.data.node_groups.new(NAME, "ShaderNodeTree")
    for name in ("Lens Step", "First View", "View Step", "Aperture", "Start"):
        tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketVector")
    for name in ("Position", "Direction"):
        tree.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketVector")
    wiring = Wiring(tree)
    constants = wiring.node("NodeGroupInput").outputs
    uv_map, attribute = wiring.node("ShaderNodeUVMap"), wiring.node("ShaderNodeAttribute")
    uv_map.uv_map, attribute.attribute_name = CELL, LENS
    cells = uv_map.outputs["UV"]
    view = wiring.vector("FLOOR", cells)
    place = wiring.vector("FRACTION", cells) if place_in_pixel else cells
    incoming = wiring.node("ShaderNodeNewGeometry").outputs["Incoming"]
    slant = _transformed(wiring, incoming, "VECTOR", "WORLD", "CAMERA")
    centre = wiring.vector("MULTIPLY_ADD", view, constants["View Step"], constants["First View"])
    start = wiring.vector("MULTIPLY_ADD", slant, constants["Aperture"], centre)
    end = wiring.vector("MULTIPLY_ADD", place, constants["Lens Step"], attribute.outputs["Vector"])
    way = wiring.vector("SUBTRACT", end, start)
    begin = wiring.vector("MULTIPLY_ADD", way, constants["Start"], start)
    # Transformed as a normal, the direction has length 1, which Cycles needs before 5.2.
    wiring.node("NodeGroupOutput", Position=_transformed(wiring, begin, "POINT", "CAMERA", "WORLD"),
                Direction=_transformed(wiring, way, "NORMAL", "CAMERA", "WORLD"))
    return tree


def _transformed(wiring: Wiring, vector: bpy.types.NodeSocket, kind: str, of: str, to: str) -> bpy.types.NodeSocket:
    node = wiring.node("ShaderNodeVectorTransform", Vector=vector)
    node.vector_type, node.convert_from, node.convert_to = kind, of, to
    return node.outputs["Vector"]
