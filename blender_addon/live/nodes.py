"""Node groups of the viewport compositor: interpolation inside each elemental image, and the display's background.

As the method ``bilinear`` offline: encode as ``reconstruct.methods.interpolation``, mix the four rendered views of the
same elemental image around each pixel linearly, and decode.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from lfsr_core.optics.eye import LiveRegion

from ..render.cards import Wiring

NAME = "LFSR Live"
ENCODE, DECODE, INTERPOLATE = f"{NAME} Encode", f"{NAME} Decode", f"{NAME} Interpolation"
NEEDED = ("CompositorNodeImageCoordinates", "CompositorNodeMapUV")


def can_interpolate() -> bool:
    """Return True if this Blender's viewport compositor has the nodes; 4.5 lacks one."""
    return (all(hasattr(bpy.types, name) for name in NEEDED)
            and "compositing_node_group" in bpy.types.Scene.bl_rna.properties)


def live_group(scene: bpy.types.Scene, region: LiveRegion, smooth: bool) -> bpy.types.NodeTree:
    """Return the compositor of ``scene``: its render over the display's background, interpolated if ``smooth``."""
    wiring = _Wiring(NAME)
    layers = wiring.node("CompositorNodeRLayers")
    layers.scene = scene
    image = wiring.node("CompositorNodeAlphaOver", Background=(*region.profile.background, 1.0),
                        Foreground=layers.outputs["Image"]).outputs[0]
    if smooth and region.scale > 1:
        image = wiring.group(_interpolation(region), image)
    return wiring.finish(image)


def _interpolation(region: LiveRegion) -> bpy.types.NodeTree:
    """Group from an image with one colour per rendered view to one with a colour per pixel."""
    wiring = _Wiring(INTERPOLATE)
    image = wiring.color(wiring.input("Image", "NodeSocketColor"), _scalar(ENCODE, _encode))
    # Vectors have z = 1, so that they can divide.
    views, corner = ((float(pair[0]), float(pair[1]), 1.0) for pair in (region.profile.views, region.corner))
    step = (region.scale,) * 3
    # Lower left corner of the pixel's elemental image on the panel, and the pixel's place in it in rendered views.
    coordinates = wiring.node("CompositorNodeImageCoordinates", Image=wiring.source)
    pixel = wiring.vector("SUBTRACT", coordinates.outputs["Pixel"], corner)
    middle = wiring.vector("ADD", pixel, (0.5, 0.5, 0))
    tile = wiring.vector("MULTIPLY", wiring.vector("FLOOR", wiring.vector("DIVIDE", middle, views)), views)
    inside = wiring.vector("DIVIDE", wiring.vector("SUBTRACT", middle, tile), step)
    place = wiring.vector("SUBTRACT", inside, (0.5, 0.5, 0))
    before = wiring.vector("FLOOR", place)
    fraction = wiring.node("ShaderNodeSeparateXYZ", Vector=wiring.vector("SUBTRACT", place, before)).outputs
    last = [count // region.scale - 1 for count in region.profile.views]

    def view(across: int, up: int) -> bpy.types.NodeSocket:
        """Return the colour of a rendered view of the tile, without interpolation, by its place in the image."""
        number = wiring.vector("ADD", before, (across, up, 0))
        number = wiring.vector("MINIMUM", wiring.vector("MAXIMUM", number, (0, 0, 0)), (*last, 0))
        middle = wiring.vector("MULTIPLY", wiring.vector("ADD", number, (0.5, 0.5, 0)), step)
        there = wiring.vector("ADD", wiring.vector("ADD", tile, middle), corner)
        # z is the alpha that Map UV returns.
        uv = wiring.vector("MULTIPLY_ADD", there, (1 / region.size[0], 1 / region.size[1], 0), (0, 0, 1))
        return wiring.node("CompositorNodeMapUV", Image=image, UV=uv, Interpolation="Nearest",
                           **{"Extension X": "Extend", "Extension Y": "Extend"}).outputs[0]

    rows = [wiring.mix(fraction["X"], view(0, up), view(1, up)) for up in (0, 1)]
    return wiring.finish(wiring.color(wiring.mix(fraction["Y"], *rows), _scalar(DECODE, _decode)))


def _scalar(name: str, fill: Callable[[_Wiring, bpy.types.NodeSocket], bpy.types.NodeSocket]) -> bpy.types.NodeTree:
    """Group that computes ``fill`` of one number."""
    wiring = _Wiring(name)
    return wiring.finish(fill(wiring, wiring.input("Value", "NodeSocketFloat")), "NodeSocketFloat")


def _encode(wiring: _Wiring, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return √x up to 1, 1 + ½·ln x above."""
    dark = wiring.scalar("SQRT", wiring.scalar("MINIMUM", wiring.scalar("MAXIMUM", value, 0.0), 1.0))
    bright = wiring.scalar("LOGARITHM", wiring.scalar("MAXIMUM", value, 1.0), 2.718281828459045)
    return wiring.scalar("MULTIPLY_ADD", bright, 0.5, dark)


def _decode(wiring: _Wiring, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return the inverse of ``_encode``: x² up to 1, e^(2·(x − 1)) above."""
    dark = wiring.scalar("POWER", wiring.scalar("MINIMUM", value, 1.0), 2.0)
    above = wiring.scalar("MAXIMUM", wiring.scalar("MULTIPLY_ADD", value, 2.0, -2.0), 0.0)
    return wiring.scalar("MULTIPLY", dark, wiring.scalar("EXPONENT", above))


class _Wiring(Wiring):
    """Wiring of a new compositor tree."""

    def __init__(self, name: str) -> None:
        super().__init__(bpy.data.node_groups.new(name, "CompositorNodeTree"))
        self.source: bpy.types.NodeSocket | None = None

    def input(self, name: str, kind: str) -> bpy.types.NodeSocket:
        """Add an input to the tree, and return its socket, which is the ``source`` too."""
        self.tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
        self.source = self.node("NodeGroupInput").outputs[0]
        return self.source

    def finish(self, value: bpy.types.NodeSocket, kind: str = "NodeSocketColor") -> bpy.types.NodeTree:
        """Make ``value`` the tree's output, and return the tree."""
        name = "Image" if kind == "NodeSocketColor" else "Value"
        self.tree.interface.new_socket(name, in_out="OUTPUT", socket_type=kind)
        self.link(value, self.node("NodeGroupOutput").inputs[0])
        return self.tree

    def group(self, tree: bpy.types.NodeTree, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the result of a group."""
        node = self.node("CompositorNodeGroup")
        node.node_tree = tree
        self.link(value, node.inputs[0])
        return node.outputs[0]

    def mix(self, fraction: bpy.types.NodeSocket, first: bpy.types.NodeSocket,
            second: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return two colours mixed; ``fraction``: of the second."""
        node = self.node("ShaderNodeMix")
        node.data_type = "RGBA"
        sockets = {socket.identifier: socket for socket in (*node.inputs, *node.outputs)}
        for name, value in (("Factor_Float", fraction), ("A_Color", first), ("B_Color", second)):
            self.link(value, sockets[name])
        return sockets["Result_Color"]

    def color(self, image: bpy.types.NodeSocket, scalar: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        """Return ``scalar`` of red, green and blue."""
        split = self.node("CompositorNodeSeparateColor", Image=image).outputs
        mapped = {name: self.group(scalar, split[name]) for name in ("Red", "Green", "Blue")}
        return self.node("CompositorNodeCombineColor", **mapped, Alpha=1.0).outputs[0]
