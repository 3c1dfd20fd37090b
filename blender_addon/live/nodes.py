"""The viewport compositor's node groups: interpolation inside each elemental image, and the display's background.

The image is encoded as ``lfsr_core.reconstruct.encoding`` does, four rendered views around each pixel are taken, those
of its own elemental image only, mixed linearly, and decoded: what the method ``bilinear`` does offline.
"""

from __future__ import annotations

import bpy

from lfsr_core.optics.live_region import LiveRegion

NAME = "LFSR Live"
ENCODE, DECODE, INTERPOLATE = f"{NAME} Encode", f"{NAME} Decode", f"{NAME} Interpolation"
NEEDED = ("CompositorNodeImageCoordinates", "CompositorNodeMapUV")
COLUMN, ROW = 190, 170


def can_interpolate() -> bool:
    """True if this Blender's viewport compositor has the nodes; 4.5 lacks one."""
    return (all(hasattr(bpy.types, name) for name in NEEDED)
            and "compositing_node_group" in bpy.types.Scene.bl_rna.properties)


def live_group(region: LiveRegion, smooth: bool) -> bpy.types.NodeTree:
    """The scene's compositor: what was rendered over the display's background, interpolated if ``smooth``."""
    wiring = _Wiring(NAME)
    layers = wiring.node("CompositorNodeRLayers")
    image = wiring.over(layers.outputs["Image"], region.profile.background)
    if smooth and region.scale > 1:
        group = wiring.group(_interpolation(region))
        wiring.link(image, group.inputs[0])
        image = group.outputs[0]
    return wiring.finish(image)


def set_scene(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> None:
    """Take the picture of ``scene``: without it the node shows nothing."""
    for node in tree.nodes:
        if node.bl_idname == "CompositorNodeRLayers":
            node.scene = scene


def _interpolation(region: LiveRegion) -> bpy.types.NodeTree:
    """From the picture with one colour per rendered view to one per pixel."""
    wiring = _Wiring(INTERPOLATE)
    picture = wiring.color(wiring.input("Image", "NodeSocketColor"), _scalar(ENCODE, _encode))
    tile, place = _place(wiring, region)
    before = wiring.math("FLOOR", place)
    share = wiring.node("ShaderNodeSeparateXYZ")
    wiring.link(wiring.math("SUBTRACT", place, before), share.inputs[0])
    rows = []
    for up in (0, 1):
        pair = [wiring.tap(picture, _uv(wiring, region, tile, wiring.math("ADD", before, (across, up, 0))))
                for across in (0, 1)]
        rows.append(wiring.mix(share.outputs["X"], *pair))
    mixed = wiring.mix(share.outputs["Y"], *rows)
    return wiring.finish(wiring.color(mixed, _scalar(DECODE, _decode)))


def _place(wiring: _Wiring, region: LiveRegion) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket]:
    """Lower left corner of the pixel's elemental image on the panel, and its place in it in rendered views."""
    coordinates = wiring.node("CompositorNodeImageCoordinates")
    wiring.link(wiring.source, coordinates.inputs["Image"])
    views = _flat(region.profile.views)
    pixel = wiring.math("SUBTRACT", coordinates.outputs["Pixel"], _flat(region.corner))
    tile = wiring.math("MULTIPLY", wiring.math("FLOOR", wiring.math("DIVIDE", wiring.middle(pixel), views)), views)
    inside = wiring.math("DIVIDE", wiring.math("SUBTRACT", wiring.middle(pixel), tile), (region.scale,) * 3)
    return tile, wiring.math("SUBTRACT", inside, (0.5, 0.5, 0))


def _uv(wiring: _Wiring, region: LiveRegion, tile: bpy.types.NodeSocket,
        view: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Where in the picture the rendered view ``view`` of a tile lies; its z is the alpha that Map UV gives."""
    last = [count // region.scale - 1 for count in region.profile.views]
    view = wiring.math("MINIMUM", wiring.math("MAXIMUM", view, (0, 0, 0)), (*last, 0))
    middle = wiring.math("MULTIPLY", wiring.math("ADD", view, (0.5, 0.5, 0)), (region.scale,) * 3)
    place = wiring.math("ADD", wiring.math("ADD", tile, middle), _flat(region.corner))
    return wiring.math("MULTIPLY_ADD", place, (1 / region.size[0], 1 / region.size[1], 0), (0, 0, 1))


def _flat(pair: tuple[int, int]) -> tuple[float, float, float]:
    """As a vector that can divide."""
    return float(pair[0]), float(pair[1]), 1.0


def _scalar(name: str, fill) -> bpy.types.NodeTree:
    wiring = _Wiring(name)
    return wiring.finish(fill(wiring, wiring.input("Value", "NodeSocketFloat")), "NodeSocketFloat")


def _encode(wiring: _Wiring, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """√x up to 1, 1 + ½·ln x above."""
    dark = wiring.scalar("SQRT", wiring.scalar("MINIMUM", wiring.scalar("MAXIMUM", value, 0.0), 1.0))
    bright = wiring.scalar("LOGARITHM", wiring.scalar("MAXIMUM", value, 1.0), 2.718281828459045)
    return wiring.scalar("MULTIPLY_ADD", bright, 0.5, dark)


def _decode(wiring: _Wiring, value: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Its inverse: the square of what is below 1, times e^(2·x) of what x is above."""
    dark = wiring.scalar("POWER", wiring.scalar("MINIMUM", value, 1.0), 2.0)
    above = wiring.scalar("MAXIMUM", wiring.scalar("MULTIPLY_ADD", value, 2.0, -2.0), 0.0)
    return wiring.scalar("MULTIPLY", dark, wiring.scalar("EXPONENT", above))


class _Wiring:
    """A compositor tree that grows to the right."""

    def __init__(self, name: str) -> None:
        self.tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
        self.source: bpy.types.NodeSocket | None = None

    def input(self, name: str, kind: str) -> bpy.types.NodeSocket:
        self.tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
        self.source = self.node("NodeGroupInput").outputs[0]
        return self.source

    def finish(self, value: bpy.types.NodeSocket, kind: str = "NodeSocketColor") -> bpy.types.NodeTree:
        name = "Image" if kind == "NodeSocketColor" else "Value"
        self.tree.interface.new_socket(name, in_out="OUTPUT", socket_type=kind)
        self.link(value, self.node("NodeGroupOutput").inputs[0])
        return self.tree

    def node(self, kind: str) -> bpy.types.Node:
        node = self.tree.nodes.new(kind)
        column, row = divmod(len(self.tree.nodes) - 1, 4)
        node.location = (COLUMN * column, -ROW * row)
        return node

    def link(self, value: bpy.types.NodeSocket | tuple | float, socket: bpy.types.NodeSocket) -> None:
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def group(self, tree: bpy.types.NodeTree) -> bpy.types.Node:
        node = self.node("CompositorNodeGroup")
        node.node_tree = tree
        return node

    def math(self, operation: str, *values: bpy.types.NodeSocket | tuple) -> bpy.types.NodeSocket:
        return self._operation("ShaderNodeVectorMath", operation, values)

    def scalar(self, operation: str, *values: bpy.types.NodeSocket | float) -> bpy.types.NodeSocket:
        return self._operation("ShaderNodeMath", operation, values)

    def middle(self, pixel: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        return self.math("ADD", pixel, (0.5, 0.5, 0))

    def tap(self, picture: bpy.types.NodeSocket, uv: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        node = self.node("CompositorNodeMapUV")
        node.inputs["Interpolation"].default_value = "Nearest"
        for axis in "XY":
            node.inputs[f"Extension {axis}"].default_value = "Extend"
        self.link(picture, node.inputs["Image"])
        self.link(uv, node.inputs["UV"])
        return node.outputs[0]

    def mix(self, share: bpy.types.NodeSocket, first: bpy.types.NodeSocket,
            second: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeMix")
        node.data_type = "RGBA"
        for name, value in (("Factor_Float", share), ("A_Color", first), ("B_Color", second)):
            self.link(value, _by_identifier(node.inputs, name))
        return _by_identifier(node.outputs, "Result_Color")

    def over(self, image: bpy.types.NodeSocket, background: tuple[float, ...]) -> bpy.types.NodeSocket:
        node = self.node("CompositorNodeAlphaOver")
        self.link((*background, 1.0), node.inputs["Background"])
        self.link(image, node.inputs["Foreground"])
        return node.outputs[0]

    def color(self, image: bpy.types.NodeSocket, scalar: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        """``scalar`` on red, green and blue."""
        split, joined = self.node("CompositorNodeSeparateColor"), self.node("CompositorNodeCombineColor")
        self.link(image, split.inputs["Image"])
        for name in ("Red", "Green", "Blue"):
            group = self.group(scalar)
            self.link(split.outputs[name], group.inputs[0])
            self.link(group.outputs[0], joined.inputs[name])
        joined.inputs["Alpha"].default_value = 1.0
        return joined.outputs[0]

    def _operation(self, kind: str, operation: str, values: tuple) -> bpy.types.NodeSocket:
        node = self.node(kind)
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.link(value, socket)
        return node.outputs[0]


def _by_identifier(sockets: bpy.types.NodeInputs | bpy.types.NodeOutputs, name: str) -> bpy.types.NodeSocket:
    return next(socket for socket in sockets if socket.identifier == name)
