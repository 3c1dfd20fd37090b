"""The panel card in Blender: one quad, and the material that sends the rays of a panel's subpixels.

``lfsr_core.optics.panel.panel_card.card_rays`` is the reference; both must stay the same formula.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.panel.panel_card import PARTS, Linear, PanelCard, Rows

from .card_parts import SLANT, Place, Wiring, add_quads, new_screen, random_pair, sent, with_z

NAME = "LFSR Panel Card"
PLACE, COUNT, START, WAY = "place", "count", "start", "way"  # attributes of the mesh
NEAR = 2e-3   # pixels from the middle of a pixel to where Cycles puts its first sample, at most
STILL = 1e-9  # of the largest element of a matrix: smaller ones are rounding errors


def new_panel_card(made: list[bpy.types.ID], card: PanelCard, distance: float, place: Place) -> bpy.types.Object:
    """Return the card, placed as a camera of ``new_camera``; ``distance`` is the display plane's."""
    screen = new_screen(made, NAME, lambda wiring: _Ray(wiring, card, made).inputs(distance, place))
    mesh = screen.data
    add_quads(mesh, card.corners[None])
    for name, values, z in ((PLACE, card.places, 0.0), (COUNT, card.counts.corners, 0.0),
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

    def inputs(self, distance: float, place: Place) -> dict[str, bpy.types.NodeSocket]:
        """Return the portal's inputs."""
        card, color, numbers = self.card, {}, self.numbers()
        if card.stretch is not None or card.mixes:
            entry = self.entry(numbers)
            if card.mixes:
                color["Color"] = self.color(entry)
        away = self.nearest(self.linear(COUNT, card.counts, 0.0), card.images)
        start = self.plus(self.linear(START, card.starts, place.gap), card.start_steps, away)
        way = self.plus(self.linear(WAY, card.ways, distance), card.way_steps, away)
        if numbers is not None:
            way = self.plus(way, card.lens_steps, self.nearest(numbers, card.lenses) if card.lenses.shift else
                            _Pair(self.wiring, numbers))
        if place.start:
            start = self.wiring.vector("MULTIPLY_ADD", way, (place.start,) * 3, start)
        return sent(self.wiring, start, way) | color

    def numbers(self) -> bpy.types.NodeSocket | None:
        """Return two random numbers from -0.5 to 0.5 for the point on the lens, None if it is always the middle."""
        if not self.card.spreads:
            return None
        return self.wiring.vector("MULTIPLY", random_pair(self.wiring), (1 / (2 * SLANT),) * 3)

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

    def entry(self, numbers: bpy.types.NodeSocket | None) -> bpy.types.NodeSocket:
        """Return the entry of the card's table for the place, and move the place to its subpixel."""
        wiring = self.wiring
        attribute = wiring.node("ShaderNodeAttribute")
        attribute.attribute_name = PLACE
        at = attribute.outputs["Vector"]
        moved = None
        if self.card.mixes and numbers is not None:
            moved = self.moved(at, numbers)
            at = wiring.vector("MULTIPLY_ADD", moved, (PARTS, 0, 0), at)
        rows, columns = self.card.table.shape[:2]
        image = wiring.node("ShaderNodeTexImage", Vector=wiring.vector(
            "MULTIPLY_ADD", wiring.vector("FLOOR", at), (1 / columns, 1 / rows, 0), (0.5 / columns, 0.5 / rows, 0)))
        image.image, image.interpolation, image.extension = self.table(), "Closest", "REPEAT"
        off = image.outputs["Color"]
        if self.card.stretch is not None:
            off = wiring.vector("MULTIPLY_ADD", wiring.vector("FRACTION", at), (*self.card.stretch, 0), off)
        self.off = _Pair(wiring, off if moved is None else wiring.vector("MULTIPLY_ADD", moved, (1, 0, 0), off))
        return image.outputs["Color"]

    def moved(self, at: bpy.types.NodeSocket, numbers: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the pixels by which the first sample of a pixel moves to the right, 0 for the others.

        Cycles puts the first sample into the pixel's middle, so that all pixels would show the same subpixel.
        """
        wiring = self.wiring
        place = wiring.vector("FRACTION", wiring.vector("MULTIPLY", at, (1 / PARTS, 1, 0)))
        away = wiring.vector("DISTANCE", place, (0.5, 0.5, 0)).node.outputs["Value"]
        return wiring.scalar("MULTIPLY", wiring.scalar("LESS_THAN", away, NEAR), _Pair(wiring, numbers).apart[1])

    def table(self) -> bpy.types.Image:
        """Return the card's table as an image."""
        rows, columns = self.card.table.shape[:2]
        image = bpy.data.images.new(NAME, columns, rows, float_buffer=True, is_data=True)
        self.made.append(image)
        image.alpha_mode = "CHANNEL_PACKED"
        opaque = np.concatenate([self.card.table, np.ones((rows, columns, 1))], -1)
        image.pixels.foreach_set(opaque.astype("f4").ravel())
        image.pack()  # which no user is then asked to do
        return image

    def color(self, entry: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return three times the colour of the subpixel."""
        wiring = self.wiring
        channel = wiring.node("ShaderNodeSeparateXYZ", Vector=entry).outputs["Z"]
        away = wiring.vector("ABSOLUTE", wiring.vector("SUBTRACT", channel, (0, 1, 2)))
        return wiring.vector("MULTIPLY_ADD", wiring.vector("MINIMUM", away, (1, 1, 1)), (-3,) * 3, (3,) * 3)


def _significant(values: Array, among: Array) -> Array:
    """``values`` without those that are rounding errors of the largest ``among`` them."""
    return np.where(np.abs(values) > STILL * np.abs(among).max(initial=0), values, 0.0)
