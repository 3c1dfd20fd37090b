"""Cards: screens before an orthographic camera that send the rays of a ray layout on every device.

The lens card has a quad for each elemental image; the panel card is one quad, whose material sends the rays of a
panel's subpixels. The functions of ``tests/support/card_rays.py`` are the
references; both must stay the same formulas. The clip plane and the live view are made of the same parts.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import bpy
import mathutils
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.panel.panel_card import PARTS, Linear, PanelCard, Rows, panel_card
from lfsr_core.optics.panel.subpixel_rays import PanelLayout
from lfsr_core.optics.rays import CameraArray, LensCard, RayLayout, lens_card

from .. import compat
from ..compat import new_data, overridden
from ..scene.array.rig import Matrix, to_blender
from ..scene.contents import rendered_layer

NAME, PANEL_NAME, PLANE_NAME = "LFSR Lens Card", "LFSR Panel Card", "LFSR Clip Plane"
CELL, LENS = "cell", "lens"   # attributes of the lens card's mesh
PLACE, COUNT, START, WAY = "place", "count", "start", "way"  # attributes of the panel card's mesh
NEAR = 2e-3   # pixels from the middle of a pixel to where Cycles puts its first sample, at most
STILL = 1e-9  # of the largest element of a matrix: smaller ones are rounding errors
SPARE = 1.5   # size of the clip plane, as a multiple of what the views see
PAST = 10.0   # how far it sends rays, as a multiple of the depth of the farthest object
HIDDEN_FROM = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")
COLUMN, ROW, ROWS = 190, 170, 4  # distances between nodes, and nodes in a column
GAP = 1e-4                    # from the camera to the camera plane, as a fraction of the display distance
# What the camera sees in front of the card, as a fraction of the distance to the world's origin: no more than single
# precision needs, since a surface there would be seen instead of the card.
CLEAR = 4e-6
LEAST_CLEAR = 1e-6            # scene units: Blender clips nothing nearer
# Half the side of the square of the camera's own aperture, as a fraction of its distance to the card: small enough
# for rays to meet the card within their pixel, and large enough for single precision.
SLANT = 2e-3


class Wiring:
    """Adds nodes to a tree, from left to right; a value is a socket to link or a constant to set."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def node(self, kind: str, **inputs: Any) -> bpy.types.Node:
        """Return a new node with the values of ``inputs``, by name."""
        node = self.tree.nodes.new(kind)
        column, row = divmod(len(self.tree.nodes) - 1, ROWS)
        node.location = (COLUMN * column, -ROW * row)
        for name, value in inputs.items():
            self.link(value, node.inputs[name])
        return node

    def link(self, value: Any, socket: bpy.types.NodeSocket) -> None:
        """Give ``socket`` a value."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def vector(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Return the result of a Vector Math node."""
        return self._operation("ShaderNodeVectorMath", operation, values)

    def scalar(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Return the result of a Math node."""
        return self._operation("ShaderNodeMath", operation, values)

    def attribute(self, name: str) -> bpy.types.NodeSocket:
        """Return an attribute of the mesh as a vector."""
        node = self.node("ShaderNodeAttribute")
        node.attribute_name = name
        return node.outputs["Vector"]

    def transformed(self, vector: bpy.types.NodeSocket, kind: str, of: str, to: str) -> bpy.types.NodeSocket:
        """Return ``vector``, of the ``kind`` POINT, VECTOR or NORMAL in the space ``of``, in the space ``to``."""
        node = self.node("ShaderNodeVectorTransform", Vector=vector)
        node.vector_type, node.convert_from, node.convert_to = kind, of, to
        return node.outputs["Vector"]

    def _operation(self, kind: str, operation: str, values: tuple[Any, ...]) -> bpy.types.NodeSocket:
        node = self.node(kind)
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.link(value, socket)
        return node.outputs[0]


def new_screen(made: list[bpy.types.ID], name: str,
               ray: Callable[[Wiring], Mapping[str, bpy.types.NodeSocket]]) -> bpy.types.Object:
    """Return an object with an empty mesh that sends camera rays on, by a Ray Portal BSDF with the inputs of ``ray``.

    Only the camera sees it. It is in no scene; all new data is added to ``made``.
    """
    mesh = bpy.data.meshes.new(name)
    screen, material = bpy.data.objects.new(name, mesh), bpy.data.materials.new(name)
    made += [mesh, screen, material]
    for kind in HIDDEN_FROM:
        setattr(screen, f"visible_{kind}", False)
    compat.use_nodes(material)
    material.node_tree.nodes.clear()
    wiring = Wiring(material.node_tree)
    wiring.node("ShaderNodeOutputMaterial", Surface=wiring.node("ShaderNodeBsdfRayPortal", **ray(wiring)).outputs[0])
    mesh.materials.append(material)
    return screen


@dataclasses.dataclass(frozen=True)
class Place:
    """Places along the array's axis, in scene units."""

    gap: float  # from the camera to the camera plane; the card is half way
    clear: float  # what the camera sees in front of the card
    start: float  # where rays start, as a fraction of the way from the camera plane to the display plane


def place_of(array: CameraArray, far: float) -> Place:
    """Return the places for an array at the distance ``far`` from the world's origin."""
    clear = max(CLEAR * max(far, array.distance), LEAST_CLEAR)
    return Place(max(GAP * array.distance, 4 * clear), clear, array.clip_start / array.distance)


def new_camera(made: list[bpy.types.ID], width: float, spreads: bool, place: Place) -> bpy.types.Object:
    """Return a camera that sees ``width`` of a card, in no scene and not placed; it and its data are added to ``made``.

    ``spreads``: whether rays of a pixel meet the card in many directions, which are random numbers for its material.
    """
    data = bpy.data.cameras.new(NAME)
    camera = bpy.data.objects.new(NAME, data)
    made += [data, camera]
    data.type, data.sensor_fit = "ORTHO", "HORIZONTAL"
    data.ortho_scale = width
    data.clip_start, data.clip_end = place.gap / 2 - place.clear, place.gap
    data.dof.use_dof = spreads
    data.dof.focus_object, data.dof.focus_distance = None, place.gap / 2
    data.dof.aperture_blades, data.dof.aperture_rotation, data.dof.aperture_ratio = 4, 0.0, 1.0
    # An orthographic camera's aperture has the radius 1 / (2 · f-stop); the corners of a square lie on it.
    data.dof.aperture_fstop = 1 / (2 * math.sqrt(2) * SLANT * place.gap / 2)
    return camera


def add_quads(mesh: bpy.types.Mesh, corners: Array) -> None:
    """Add a quad to an empty ``mesh`` for each four of ``corners`` (quads, 4, 2)."""
    count = len(corners)
    mesh.vertices.add(4 * count)
    mesh.loops.add(4 * count)
    mesh.polygons.add(count)
    mesh.vertices.foreach_set("co", with_z(corners.reshape(-1, 2), 0.0))
    mesh.loops.foreach_set("vertex_index", range(4 * count))
    mesh.polygons.foreach_set("loop_start", range(0, 4 * count, 4))


def with_z(points: Array, z: float) -> Array:
    """Return points (n, 2) as vectors, one after the other."""
    return np.column_stack([points, np.full(len(points), z)]).astype("f4").ravel()


def random_pair(wiring: Wiring) -> bpy.types.NodeSocket:
    """Return a vector with two random numbers from -SLANT to SLANT, from the camera's aperture."""
    return wiring.transformed(wiring.node("ShaderNodeNewGeometry").outputs["Incoming"], "VECTOR", "WORLD", "CAMERA")


def sent(wiring: Wiring, begin: bpy.types.NodeSocket, way: bpy.types.NodeSocket) -> dict[str, bpy.types.NodeSocket]:
    """Return the portal's inputs for a ray from ``begin`` along ``way``, both in the camera's space."""
    # Transformed as a normal, the direction has length 1, which Cycles needs before 5.2.
    return {"Position": wiring.transformed(begin, "POINT", "CAMERA", "WORLD"),
            "Direction": wiring.transformed(way, "NORMAL", "CAMERA", "WORLD")}


def distance_to_volume(scene: bpy.types.Scene, point: mathutils.Vector) -> float:
    """Return the scene units from ``point``, inside or outside, to the nearest surface of a volume; inf without any.

    Volumes are meshes with a volume shader, and volume objects (their bounding boxes). Instances are ignored.
    """
    graph, distances = bpy.context.evaluated_depsgraph_get(), [math.inf]
    for item in rendered_layer(scene).objects:
        trees = (slot.material.node_tree for slot in item.material_slots if slot.material is not None)
        outputs = (node for tree in trees if tree for node in tree.nodes
                   if node.bl_idname == "ShaderNodeOutputMaterial")
        if item.hide_render or not (item.type == "VOLUME" or any(node.inputs["Volume"].is_linked for node in outputs)):
            continue
        item = item.evaluated_get(graph)
        if item.type == "MESH" and item.is_evaluated and item.data.polygons:  # else hidden in the viewport
            is_there, nearest, _, _ = item.closest_point_on_mesh(item.matrix_world.inverted_safe() @ point)
            if is_there:
                distances.append((item.matrix_world @ nearest - point).length)
                continue
        corners = [item.matrix_world @ mathutils.Vector(corner) for corner in item.bound_box]
        low, high = (mathutils.Vector(map(end, zip(*corners, strict=True))) for end in (min, max))
        outside = mathutils.Vector(max(low[i] - point[i], 0, point[i] - high[i]) for i in range(3)).length
        distances.append(outside or min(min(point[i] - low[i], high[i] - point[i]) for i in range(3)))
    return min(distances)


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
    """Return the node group of ``tests/support/card_rays.py``: the card's attributes -> a world-space ray."""
    tree = bpy.data.node_groups.new(NAME, "ShaderNodeTree")
    for name in ("Lens Step", "First View", "View Step", "Aperture", "Start"):
        tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketVector")
    for name in ("Position", "Direction"):
        tree.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketVector")
    wiring = Wiring(tree)
    constants = wiring.node("NodeGroupInput").outputs
    uv_map, lens = wiring.node("ShaderNodeUVMap"), wiring.attribute(LENS)
    uv_map.uv_map = CELL
    cells = uv_map.outputs["UV"]
    view = wiring.vector("FLOOR", cells)
    place = wiring.vector("FRACTION", cells) if place_in_pixel else cells
    centre = wiring.vector("MULTIPLY_ADD", view, constants["View Step"], constants["First View"])
    start = wiring.vector("MULTIPLY_ADD", random_pair(wiring), constants["Aperture"], centre)
    way = wiring.vector("SUBTRACT", wiring.vector("MULTIPLY_ADD", place, constants["Lens Step"], lens), start)
    wiring.node("NodeGroupOutput", **sent(wiring, wiring.vector("MULTIPLY_ADD", way, constants["Start"], start), way))
    return tree


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

    def times(self, matrix: Array, base: Any) -> Any:
        """Return ``base`` plus ``matrix`` (2, 2) times the pair."""
        matrix, wiring = _significant(matrix, matrix), self.wiring
        if self.vector is not None and not matrix[0, 1] and not matrix[1, 0]:
            return wiring.vector("MULTIPLY_ADD", self.vector, (matrix[0, 0], matrix[1, 1], 0), base)
        for column in (0, 1):
            if matrix[:, column].any():
                base = wiring.vector("MULTIPLY_ADD", self.apart[column], (*matrix[:, column], 0), base)
        return base


def new_panel_card(made: list[bpy.types.ID], card: PanelCard, distance: float, place: Place) -> bpy.types.Object:
    """Return the card, placed as a camera of ``new_camera``; ``distance`` is the display plane's."""
    def ray(wiring: Wiring) -> dict[str, bpy.types.NodeSocket]:
        color, off = dict[str, bpy.types.NodeSocket](), None  # off: from the place to that of the subpixel's light
        # Two random numbers from -0.5 to 0.5 for the point on the lens, none if it is always the middle.
        numbers = wiring.vector("MULTIPLY", random_pair(wiring), (1 / (2 * SLANT),) * 3) if card.spreads else None
        if card.stretch is not None or card.mixes:
            at, moved = wiring.attribute(PLACE), None
            if card.mixes and numbers is not None:
                # Cycles puts the first sample into the pixel's middle, so that all pixels would show the same subpixel:
                # that sample moves to the right, by some pixels.
                inside = wiring.vector("FRACTION", wiring.vector("MULTIPLY", at, (1 / PARTS, 1, 0)))
                off_middle = wiring.vector("DISTANCE", inside, (0.5, 0.5, 0)).node.outputs["Value"]
                moved = wiring.scalar("MULTIPLY", wiring.scalar("LESS_THAN", off_middle, NEAR),
                                      _Pair(wiring, numbers).apart[1])
                at = wiring.vector("MULTIPLY_ADD", moved, (PARTS, 0, 0), at)
            rows, columns = card.table.shape[:2]
            table = bpy.data.images.new(PANEL_NAME, columns, rows, float_buffer=True, is_data=True)
            made.append(table)
            table.alpha_mode = "CHANNEL_PACKED"
            table.pixels.foreach_set(np.concatenate([card.table, np.ones((rows, columns, 1))], -1).astype("f4").ravel())
            table.pack()  # else Blender would ask the user to
            entry = wiring.node("ShaderNodeTexImage", Vector=wiring.vector(
                "MULTIPLY_ADD", wiring.vector("FLOOR", at), (1 / columns, 1 / rows, 0),
                (0.5 / columns, 0.5 / rows, 0)))
            entry.image, entry.interpolation, entry.extension = table, "Closest", "REPEAT"
            vector = entry.outputs["Color"]
            if card.stretch is not None:
                vector = wiring.vector("MULTIPLY_ADD", wiring.vector("FRACTION", at), (*card.stretch, 0), vector)
            off = _Pair(wiring, vector if moved is None else wiring.vector("MULTIPLY_ADD", moved, (1, 0, 0), vector))
            if card.mixes:  # three times the colour of the subpixel
                channel = wiring.node("ShaderNodeSeparateXYZ", Vector=entry.outputs["Color"]).outputs["Z"]
                others = wiring.vector("ABSOLUTE", wiring.vector("SUBTRACT", channel, (0, 1, 2)))
                color["Color"] = wiring.vector("MULTIPLY_ADD", wiring.vector("MINIMUM", others, (1, 1, 1)), (-3,) * 3,
                                               (3,) * 3)

        def linear(name: str, quantity: Linear, z: float) -> Any:
            """Return ``quantity`` where the light of the place comes from, a socket or a constant."""
            if not _significant(quantity.corners - quantity.corners[0], quantity.corners).any():
                return (*quantity.corners[0], z)
            value = wiring.attribute(name)
            return value if off is None else off.times(quantity.per_pixel, value)

        away = _nearest(wiring, linear(COUNT, card.counts, 0.0), card.images)
        start = away.times(card.start_steps, linear(START, card.starts, place.gap))
        way = away.times(card.way_steps, linear(WAY, card.ways, distance))
        if numbers is not None:
            on_lens = _nearest(wiring, numbers, card.lenses) if card.lenses.shift else _Pair(wiring, numbers)
            way = on_lens.times(card.lens_steps, way)
        if place.start:
            start = wiring.vector("MULTIPLY_ADD", way, (place.start,) * 3, start)
        return sent(wiring, start, way) | color

    screen = new_screen(made, PANEL_NAME, ray)
    mesh = screen.data
    add_quads(mesh, card.corners[None])
    for name, values, z in ((PLACE, card.places, 0.0), (COUNT, card.counts.corners, 0.0),
                            (START, card.starts.corners, place.gap), (WAY, card.ways.corners, distance)):
        mesh.attributes.new(name, "FLOAT_VECTOR", "CORNER").data.foreach_set("vector", with_z(values, z))
    mesh.update(calc_edges=True)
    return screen


def _nearest(wiring: Wiring, counts: bpy.types.NodeSocket, rows: Rows) -> _Pair:
    """Return how far ``counts`` are from the lattice point nearest to them."""
    if not rows.shift:
        return _Pair(wiring, wiring.vector("WRAP", counts, (0.5,) * 3, (-0.5,) * 3))
    across, up = _Pair(wiring, counts).apart
    below = wiring.scalar("FLOOR", up)
    inside = wiring.scalar("SUBTRACT", up, below)
    first = wiring.scalar("WRAP", wiring.scalar("MULTIPLY_ADD", below, -rows.shift, across), 0.5, -0.5)
    second = wiring.scalar("WRAP", wiring.scalar("SUBTRACT", first, rows.shift), 0.5, -0.5)
    squares = wiring.scalar("SUBTRACT", wiring.scalar("MULTIPLY", second, second),
                            wiring.scalar("MULTIPLY", first, first))
    above = wiring.scalar("LESS_THAN", squares, wiring.scalar("MULTIPLY_ADD", inside, 2 * rows.square, -rows.square))
    return _Pair(wiring, apart=(
        wiring.scalar("MULTIPLY_ADD", above, wiring.scalar("SUBTRACT", second, first), first),
        wiring.scalar("SUBTRACT", inside, above)))


def _significant(values: Array, among: Array) -> Array:
    """``values`` without those that are rounding errors of the largest ``among`` them."""
    return np.where(np.abs(values) > STILL * np.abs(among).max(initial=0), values, 0.0)


@contextmanager
def card_camera(scene: bpy.types.Scene, layout: RayLayout | PanelLayout,
                matrix_world: Matrix) -> Iterator[bpy.types.Object]:
    """Make a camera with the card of ``layout`` the scene's camera inside the block."""
    frame, distance = to_blender(matrix_world), layout.array.distance
    place = place_of(layout.array, frame.translation.length)
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


@contextmanager
def clip_plane(scene: bpy.types.Scene, layout: RayLayout | PanelLayout, matrix_world: Matrix) -> Iterator[float]:
    """Hide what lies beyond the array's clip from the rays of ``layout``; yield the depth, inf if nothing does."""
    frame, depth = to_blender(matrix_world), layout.array.clip[1] if layout.array.clip else math.inf
    toward, depths = frame.inverted(), [0.0]  # of the corners of all objects' bounding boxes
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type not in {"EMPTY", "CAMERA", "LIGHT"}:
            matrix = toward @ instance.matrix_world
            depths += [-(matrix @ mathutils.Vector(corner)).z for corner in instance.object.bound_box]
    if (farthest := max(depths)) <= depth:
        yield math.inf
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
            yield depth
