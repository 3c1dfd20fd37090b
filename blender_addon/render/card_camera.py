"""A camera that sends the rays of a ray layout on every device, through a lens card or a panel card; the lens card."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import mathutils

from lfsr_core.optics.lens_card import LensCard, lens_card
from lfsr_core.optics.panel.panel_card import panel_card
from lfsr_core.optics.panel.subpixel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout

from ..scene.array.rig import Matrix, to_blender
from ..scene.overrides import new_data, overridden
from .card_parts import (
    NAME,
    SLANT,
    Place,
    Wiring,
    add_quads,
    distance_to_volume,
    new_camera,
    new_screen,
    place_of,
    random_pair,
    sent,
    with_z,
)
from .panel_card import new_panel_card

CELL, LENS = "cell", "lens"   # attributes of the lens card's mesh


@contextmanager
def card_camera(scene: bpy.types.Scene, layout: RayLayout | PanelLayout, matrix_world: Matrix,
                clip_start: float = 0.0) -> Iterator[bpy.types.Object]:
    """Make a camera with the card of ``layout`` the scene's camera inside the block; rays start at ``clip_start``."""
    frame, distance = to_blender(matrix_world), layout.array.distance
    place = place_of(layout.array, frame.translation.length, clip_start)
    # Cycles asks at the card which volumes a path begins in.
    radius = distance_to_volume(scene, frame.translation)
    with new_data() as made:
        if isinstance(layout, PanelLayout):
            panel = panel_card(layout, radius)
            camera = new_camera(made, layout.size[0] * panel.pixel, panel.spreads, place)
            screen = new_panel_card(made, panel, distance, place)
        else:
            card = lens_card(layout, radius)
            camera = new_camera(made, layout.size[0] * card.pixel, card.spreads, place)
            screen = new_card(made, card, distance, place)
        for item, behind in ((camera, place.gap), (screen, place.gap / 2)):
            item.matrix_world = frame @ mathutils.Matrix.Translation((0, 0, behind))
            scene.collection.objects.link(item)
        # The card is one more surface that a path passes through.
        with (overridden(scene, {"camera": camera}), overridden(
                scene.cycles, {"transparent_max_bounces": scene.cycles.transparent_max_bounces + 1})):
            yield camera


def new_card(made: list[bpy.types.ID], card: LensCard, distance: float, place: Place) -> bpy.types.Object:
    """Return a lens card, placed as a camera of ``new_camera``: a quad for each elemental image, and its material.

    ``distance`` is the display plane's.
    """
    def ray(wiring: Wiring) -> dict[str, bpy.types.NodeSocket]:
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
        return {name: rays.outputs[name] for name in ("Position", "Direction")}

    screen = new_screen(made, NAME, ray)
    mesh, targets = screen.data, with_z(card.targets, distance + place.gap)
    add_quads(mesh, card.corners)
    mesh.attributes.new(CELL, "FLOAT2", "CORNER").data.foreach_set("vector", card.cells.astype("f4").ravel())
    mesh.attributes.new(LENS, "FLOAT_VECTOR", "FACE").data.foreach_set("vector", targets)
    mesh.update(calc_edges=True)
    return screen


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
    centre = wiring.vector("MULTIPLY_ADD", view, constants["View Step"], constants["First View"])
    start = wiring.vector("MULTIPLY_ADD", random_pair(wiring), constants["Aperture"], centre)
    end = wiring.vector("MULTIPLY_ADD", place, constants["Lens Step"], attribute.outputs["Vector"])
    way = wiring.vector("SUBTRACT", end, start)
    begin = wiring.vector("MULTIPLY_ADD", way, constants["Start"], start)
    wiring.node("NodeGroupOutput", **sent(wiring, begin, way))
    return tree


PLANE_NAME = "LFSR Clip Plane"
SPARE = 1.5   # size of the plane, as a multiple of what the views see
PAST = 10.0   # how far rays are sent, as a multiple of the depth of the farthest object


@contextmanager
def clip_plane(scene: bpy.types.Scene, layout: RayLayout | PanelLayout, matrix_world: Matrix,
               depth: float) -> Iterator[bool]:
    """Hide everything beyond ``depth`` from the rays of ``layout`` inside the block; yield True if anything is."""
    frame = to_blender(matrix_world)
    toward, depths = frame.inverted(), [0.0]  # of the corners of all objects' bounding boxes
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type not in {"EMPTY", "CAMERA", "LIGHT"}:
            matrix = toward @ instance.matrix_world
            depths += [-(matrix @ mathutils.Vector(corner)).z for corner in instance.object.bound_box]
    farthest = max(depths)
    if farthest <= depth:
        yield False
        return

    def ray(wiring: Wiring) -> dict[str, bpy.types.NodeSocket]:
        geometry = wiring.node("ShaderNodeNewGeometry").outputs
        far = wiring.vector("MULTIPLY_ADD", geometry["Incoming"], (-PAST * farthest,) * 3, geometry["Position"])
        return {"Position": far, "Direction": wiring.vector("MULTIPLY", geometry["Incoming"], (-1.0,) * 3)}

    with new_data() as made:
        # Every ray passes through a square of this size at the depth.
        array, reach = layout.array, layout.reach
        half = SPARE * (reach + (reach + max(array.half_width, array.half_height)) * depth / array.distance)
        screen = new_screen(made, PLANE_NAME, ray)
        corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
        screen.data.from_pydata(corners, [], [(0, 1, 2, 3)])
        screen.matrix_world = frame @ mathutils.Matrix.Translation((0, 0, -depth))
        scene.collection.objects.link(screen)
        with overridden(scene.cycles, {"transparent_max_bounces": scene.cycles.transparent_max_bounces + 1}):
            yield True
