"""The lens card in Blender: a quad for each elemental image, and the material that sends the rays of its pixels."""

from __future__ import annotations

import bpy

from lfsr_core.optics.lens_card import LensCard

from .card_parts import NAME, SLANT, Place, add_quads, random_pair, sent, with_z
from .wiring import Wiring, new_screen

CELL, LENS = "cell", "lens"   # attributes of the mesh


def new_card(made: list[bpy.types.ID], card: LensCard, distance: float, place: Place) -> bpy.types.Object:
    """Return the card, placed as a camera of ``new_camera``; ``distance`` is the display plane's."""
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
    _fill(screen.data, card, distance + place.gap)
    return screen


def _fill(mesh: bpy.types.Mesh, card: LensCard, depth: float) -> None:
    """Add a quad with its attributes for each tile; ``depth``: of the display plane in the camera's space."""
    add_quads(mesh, card.corners)
    mesh.attributes.new(CELL, "FLOAT2", "CORNER").data.foreach_set("vector", card.cells.astype("f4").ravel())
    mesh.attributes.new(LENS, "FLOAT_VECTOR", "FACE").data.foreach_set("vector", with_z(card.targets, depth))
    mesh.update(calc_edges=True)


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
