"""The panel card in Blender: one quad, and the material that sends the rays of a panel's subpixels.

``lfsr_core.optics.panel.panel_card.card_rays`` is the reference; both must stay the same formula.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.panel.panel_card import Linear, PanelCard, Rows

from .card_parts import SLANT, Place, add_quads, random_pair, sent, with_z
from .wiring import Wiring, new_screen

NAME = "LFSR Panel Card"
SUBPIXEL, COUNT, START, WAY = "subpixel", "count", "start", "way"  # attributes of the mesh
STILL = 1e-9  # of the largest element of a matrix: smaller ones are rounding errors


def new_panel_card(made: list[bpy.types.ID], card: PanelCard, distance: float, place: Place,
                   of_subpixels: bool = True) -> bpy.types.Object:
    """Return the card, placed as a camera of ``new_camera``; ``distance`` is the display plane's.

    Unless ``of_subpixels`` a pixel of the image shows the three subpixels, each ray one of them in its colour.
    """
    screen = new_screen(made, NAME, lambda wiring: _Ray(wiring, card, made).inputs(distance, place, of_subpixels))
    mesh = screen.data
    add_quads(mesh, card.corners[None])
    for name, values, z in ((SUBPIXEL, card.subpixels, 0.0), (COUNT, card.counts.corners, 0.0),
                            (START, card.starts.corners, place.gap), (WAY, card.ways.corners, distance)):
        mesh.attributes.new(name, "FLOAT_VECTOR", "CORNER").data.foreach_set("vector", with_z(values, z))
    mesh.update(calc_edges=True)
    return screen


class _Pair:
    """Two numbers as a vector, or apart."""

    def __init__(self, wiring: Wiring, vector: bpy.types.NodeSocket | None = None,
                 apart: tuple[bpy.types.NodeSocket, bpy.types.NodeSocket] | None = None) -> None:
        self.wiring, self.vector, self._apart = wiring, vector, apart

    @property
    def apart(self) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]:
        if self._apart is None:
            split = self.wiring.node("ShaderNodeSeparateXYZ", Vector=self.vector).outputs
            self._apart = split["X"], split["Y"]
        return self._apart


class _Ray:
    """Adds the nodes of a card's material."""

    def __init__(self, wiring: Wiring, card: PanelCard, made: list[bpy.types.ID]) -> None:
        self.wiring, self.card, self.made = wiring, card, made
        self.off: _Pair | None = None

    def inputs(self, distance: float, place: Place, of_subpixels: bool) -> dict[str, bpy.types.NodeSocket]:
        """Return the portal's inputs."""
        card, color = self.card, {}
        if card.stretch is not None or not of_subpixels:
            entry = self.entry()
            if not of_subpixels:
                color["Color"] = self.color(_Pair(self.wiring, entry))
        away = self.nearest(self.linear(COUNT, card.counts, 0.0), card.images)
        start = self.plus(self.linear(START, card.starts, place.gap), card.start_steps, away)
        way = self.plus(self.linear(WAY, card.ways, distance), card.way_steps, away)
        if card.spreads:
            numbers = _Pair(self.wiring, random_pair(self.wiring))
            if card.lenses.shift:
                spread = self.wiring.vector("MULTIPLY", numbers.vector, (1 / (2 * SLANT),) * 3)
                way = self.plus(way, card.lens_steps, self.nearest(spread, card.lenses))
            else:
                way = self.plus(way, card.lens_steps / (2 * SLANT), numbers)
        if place.start:
            start = self.wiring.vector("MULTIPLY_ADD", way, (place.start,) * 3, start)
        return sent(self.wiring, start, way) | color

    def linear(self, name: str, quantity: Linear, z: float) -> Any:
        """Return ``quantity`` where the light of the place comes from, a socket or a constant; ``z``: of its vector."""
        if not _significant(quantity.corners - quantity.corners[0], quantity.corners).any():
            return (*quantity.corners[0], z)
        attribute = self.wiring.node("ShaderNodeAttribute")
        attribute.attribute_name = name
        value = attribute.outputs["Vector"]
        return value if self.off is None else self.plus(value, quantity.per_pixel, self.off)

    def plus(self, base: Any, matrix: Array, pair: _Pair) -> Any:
        """Return ``base`` plus a matrix (2, 2) times a pair."""
        matrix = _significant(matrix, matrix)
        if pair.vector is not None and not matrix[0, 1] and not matrix[1, 0]:
            return self.wiring.vector("MULTIPLY_ADD", pair.vector, (matrix[0, 0], matrix[1, 1], 0), base)
        for column in (0, 1):
            if matrix[:, column].any():
                base = self.wiring.vector("MULTIPLY_ADD", pair.apart[column], (*matrix[:, column], 0), base)
        return base

    def nearest(self, counts: bpy.types.NodeSocket, rows: Rows) -> _Pair:
        """Return how far ``counts`` are from the lattice point nearest to them."""
        wiring = self.wiring
        if not rows.shift:
            return _Pair(wiring, wiring.vector("WRAP", counts, (0.5,) * 3, (-0.5,) * 3))
        across, up = _Pair(wiring, counts).apart
        below = wiring.scalar("FLOOR", up)
        inside = wiring.scalar("SUBTRACT", up, below)
        first = self._wrapped(wiring.scalar("MULTIPLY_ADD", below, -rows.shift, across))
        second = self._wrapped(wiring.scalar("SUBTRACT", first, rows.shift))
        squares = wiring.scalar("SUBTRACT", wiring.scalar("MULTIPLY", second, second),
                                wiring.scalar("MULTIPLY", first, first))
        above = wiring.scalar("LESS_THAN", squares,
                              wiring.scalar("MULTIPLY_ADD", inside, 2 * rows.square, -rows.square))
        return _Pair(wiring, apart=(
            wiring.scalar("MULTIPLY_ADD", above, wiring.scalar("SUBTRACT", second, first), first),
            wiring.scalar("SUBTRACT", inside, above)))

    def _wrapped(self, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        return self.wiring.scalar("WRAP", value, 0.5, -0.5)

    def entry(self) -> bpy.types.NodeSocket:
        """Return the entry of the card's table for the place, and move the place to its subpixel."""
        wiring = self.wiring
        attribute = wiring.node("ShaderNodeAttribute")
        attribute.attribute_name = SUBPIXEL
        at = attribute.outputs["Vector"]
        rows, columns = self.card.table.shape[:2]
        image = wiring.node("ShaderNodeTexImage", Vector=wiring.vector(
            "MULTIPLY_ADD", wiring.vector("FLOOR", at), (1 / columns, 1 / rows, 0), (0.5 / columns, 0.5 / rows, 0)))
        image.image, image.interpolation, image.extension = self.table(), "Closest", "REPEAT"
        if self.card.stretch is not None:
            self.off = _Pair(wiring, wiring.vector(
                "MULTIPLY_ADD", wiring.vector("FRACTION", at), (*self.card.stretch, 0), image.outputs["Color"]))
        return image.outputs["Color"]

    def table(self) -> bpy.types.Image:
        """Return the card's table as an image."""
        rows, columns = self.card.table.shape[:2]
        image = bpy.data.images.new(NAME, columns, rows, float_buffer=True, is_data=True)
        self.made.append(image)
        image.alpha_mode = "CHANNEL_PACKED"
        opaque = np.concatenate([self.card.table, np.ones((rows, columns, 1))], -1)
        image.pixels.foreach_set(opaque.astype("f4").ravel())
        image.update()
        return image

    def color(self, entry: _Pair) -> bpy.types.NodeSocket:
        """Return three times the colour of the subpixel."""
        wiring = self.wiring
        channel = wiring.node("ShaderNodeSeparateXYZ", Vector=entry.vector).outputs["Z"]
        away = wiring.vector("ABSOLUTE", wiring.vector("SUBTRACT", channel, (0, 1, 2)))
        return wiring.vector("MULTIPLY_ADD", wiring.vector("MINIMUM", away, (1, 1, 1)), (-3,) * 3, (3,) * 3)


def _significant(values: Array, among: Array) -> Array:
    """``values`` without those that are rounding errors of the largest ``among`` them."""
    return np.where(np.abs(values) > STILL * np.abs(among).max(initial=0), values, 0.0)
