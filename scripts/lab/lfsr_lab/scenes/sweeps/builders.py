"""One builder per parameter sweep: ``BUILDERS[name](stage, value)`` fills an empty stage."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import Graph, again, paint, principled, put, sun, world
from lfsr_lab.scenes.shared.surfaces import Surface
from lfsr_lab.scenes.sweeps.space import card_centre, card_of_motion, hole
from lfsr_lab.scenes.sweeps.stage import Stage, between, board, glow, object_vector, to_background, turned

BODY_SIZE = 0.95  # radius in lenses
JITTER = 0.35


@dataclasses.dataclass(frozen=True)
class Grid:
    """How points are spread, in lenses seen from the viewing position."""

    cell: float = 2.5  # from point to point
    reach: tuple[float, float] | None = None  # to either side of the middle, None for all that any view sees


def lattice(stage: Stage, low: float, high: float, grid: Grid) -> Iterator[tuple[Array, float]]:
    """(place, lens size there) of scattered points between depths ``low`` and ``high``."""
    cell, reach = grid.cell, grid.reach
    space, rng = stage.space, stage.rng
    limits = [max(space.window(y)[axis] / space.magnified(y) for y in (low, high)) + cell for axis in (0, 1)]
    columns, rows = (int((reach or limits)[axis] / cell) for axis in (0, 1))
    for column, row in itertools.product(range(-columns, columns + 1), range(-rows, rows + 1)):
        y, (dx, dz) = rng.uniform(low, high) if high > low else low, rng.uniform(-JITTER, JITTER, 2)
        size = space.magnified(y)
        shifted = column + 0.5 * (row % 2)
        yield np.array([(shifted * cell + dx) * size, y, (row * cell + dz) * size]), size


def bodies(stage: Stage, low: float, high: float, materials: Sequence[bpy.types.Material],
           grid: Grid = Grid()) -> list[bpy.types.Object]:
    """Balls, boxes, rings and pillows of the given materials between two depths."""
    ring = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    circle = np.stack([np.cos(ring), np.sin(ring), 0 * ring], -1) * 0.7
    shapes = [surfaces.sphere(), surfaces.unit_sized(surfaces.box(0.7, 0.6, 0.5)),
              surfaces.tube(circle, 0.28, 16, closed=True), surfaces.superquadric(stage.rng)]
    kinds = [put(shape, material, (0, 0, 0), name=f"body {index}")
             for index, (shape, material) in enumerate(zip(itertools.cycle(shapes), materials, strict=False))]
    made = [again(kinds[index % len(kinds)], place, size * BODY_SIZE, np.radians(stage.rng.uniform(0, 180, 3)))
            for index, (place, size) in enumerate(lattice(stage, low, high, grid))]
    for kind in kinds:
        bpy.data.objects.remove(kind)
    return made


def print_of(graph: Graph, scale: float) -> bpy.types.NodeSocket:
    """Colours of a detailed print; its coarsest parts are 1 / ``scale`` across."""
    vector = object_vector(graph)
    coarse = graph.node("ShaderNodeTexNoise", {"Vector": vector, "Scale": scale, "Detail": 4.0, "Roughness": 0.7})
    cells = graph.node("ShaderNodeTexVoronoi", {"Vector": vector, "Scale": scale * 2})
    mix = graph.node("ShaderNodeMix", data_type="RGBA")
    first, second = (socket for socket in mix.inputs if socket.type == "RGBA")
    graph.feed(mix.inputs[0], coarse.outputs[0])
    graph.feed(first, between(graph, coarse.outputs[0], (0.03, 0.08, 0.3), (0.9, 0.6, 0.2)))
    graph.feed(second, between(graph, cells.outputs["Distance"], (0.6, 0.05, 0.04), (0.85, 0.9, 0.8), sharp=True))
    return next(socket for socket in mix.outputs if socket.type == "RGBA")


def printed(name: str, scale: float, **inputs: float) -> bpy.types.Material:
    """Matt material with a detailed print."""
    material, graph, shader = principled(name, **{"Roughness": 1.0, "Specular_IOR_Level": 0.0} | inputs)
    graph.feed(shader.inputs["Base Color"], print_of(graph, scale))
    return material


def tiles(graph: Graph, size: tuple[float, float], dark: tuple[float, ...], bright: tuple[float, ...],
          offset: tuple[float, float, float] = (0.0, 0.5, 0.0)) -> bpy.types.NodeSocket:
    """Checkerboard colours of tiles of ``size`` (x, z); ``offset`` in tiles, the middle of one along y."""
    vector = object_vector(graph, Location=offset, Scale=(1 / size[0], 1 / size[0], 1 / size[1]))
    return graph.node("ShaderNodeTexChecker", {"Vector": vector, "Scale": 1.0, "Color1": (*bright, 1.0),
                                               "Color2": (*dark, 1.0)}).outputs["Color"]


def every_sort() -> list[bpy.types.Material]:
    """Printed, glossy, metal, glass and plain surfaces."""
    return [printed("print", 1.5), paint("plastic", (0.05, 0.2, 0.65), 0.15),
            paint("gold", (1.0, 0.7, 0.3), 0.25, Metallic=1.0), glass(1.45, 0.0),
            printed("fine print", 4.0, Roughness=0.4, Specular_IOR_Level=0.5), paint("white", (0.8, 0.8, 0.75))]


def opaque_sorts() -> list[bpy.types.Material]:
    """Printed and plain surfaces, nothing that shows something else's depth."""
    return [printed("print", 1.5), paint("matt blue", (0.05, 0.2, 0.65), 0.9),
            printed("fine print", 4.0), paint("white", (0.8, 0.8, 0.75), 0.9)]


def flakes(stage: Stage, low: float, high: float, half: float, per_lens: float) -> Surface:
    """Square flakes of half a side ``half``, turned at random, ``per_lens`` of them in each lens, as one surface."""
    space, rng = stage.space, stage.rng
    reach = np.array([max(space.window(y)[axis] / space.magnified(y) for y in (low, high)) for axis in (0, 1)])
    count = max(1, round(per_lens * 4 * math.prod(reach) / space.row))
    y = rng.uniform(low, high, count)
    size = np.vectorize(space.magnified)(y)
    x, z = (rng.uniform(-1, 1, count) * reach[axis] * size for axis in (0, 1))
    turns = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]  # two of three axes at right angles span a flake
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    offsets = size[:, None, None] * np.einsum("cu,nku->nck", corners, turns[..., :2])
    vertices = np.stack([x, y, z], -1)[:, None] + offsets
    return Surface(vertices.reshape(-1, 3), np.arange(4 * count).reshape(-1, 4), smooth=False)


def glass(index: float, roughness: float) -> bpy.types.Material:
    """Clear glass."""
    return paint("glass", (0.97, 0.99, 0.98), roughness, Transmission_Weight=1.0, IOR=index)


def wires(stage: Stage, y: float, thickness: float, material: bpy.types.Material) -> list[bpy.types.Object]:
    """Straight crossing wires at depth ``y`` that reach across all that any view sees."""
    width, height = stage.space.window(y)
    step = 2.2 * stage.space.magnified(y)
    made = []
    for degrees in (10.0, 100.0, 55.0):
        along = np.array([math.cos(math.radians(degrees)), 0.0, math.sin(math.radians(degrees))])
        across = np.array([-along[2], 0.0, along[0]])
        length = math.hypot(width, height) + step
        every = step * (2 if degrees == 55.0 else 1)
        for index in range(-int(length / every), int(length / every) + 1):
            place = across * every * (index + 0.3)
            path = np.stack([place - along * length, place + along * length])
            made.append(put(surfaces.tube(path, thickness / 2, 16), material, (0.0, y, 0.0), name="wire"))
    return made


WORLD_STRENGTH = 0.45
BIG = 1.15   # boards reach a little over what the views see
WIRE_DEPTH, BOARD_DEPTH = 0.5, 0.75  # usable depths behind the display
TILE = 1.5  # lenses across
LAMP_POWER = 1.0   # radiance × radius² of a glowing ball, in lens pitches
FLAKE_DEPTH, FLAKE = 0.3, 0.06  # usable depths before and behind the display; half a side in lenses
GROUND = 0.2  # radiance of a background that is as bright as the subject
MIRROR_GLOW, CAUSTIC_FILL, DARK_TILE = 0.8, 0.06, 0.05
GLASS, SUN = 1.45, math.radians(0.5)  # index of refraction; degrees across


def light() -> None:
    """Light from all sides and from the upper left."""
    world()
    sun()


def samples(stage: Stage, _value: float) -> None:
    """Every kind of surface, half a usable range deep."""
    light()
    bodies(stage, stage.space.depth(-0.5), stage.space.depth(0.5), every_sort())


def depth(stage: Stage, usable: float) -> None:
    """Bodies at one depth."""
    light()
    y = stage.space.depth(usable)
    bodies(stage, y, y, opaque_sorts())


def wire(stage: Stage, pixels: float) -> None:
    """Crossing wires."""
    light()
    y = stage.space.depth(WIRE_DEPTH)
    wires(stage, y, pixels * stage.space.footprint(y), paint("wire", (0.85, 0.8, 0.7), 0.6))


def texture(stage: Stage, nyquist: float) -> None:
    """A board with a slanted sine grating in two directions."""
    world()
    y = stage.space.depth(1)
    turns = 2 * math.pi * nyquist * stage.space.nyquist(y)
    material, graph, shader = principled("grating", Roughness=1.0, Specular_IOR_Level=0.0)
    graph.feed(shader.inputs["Base Color"], grating(graph, turns))
    full_board(stage, "grating", y, material)


def grating(graph: Graph, turns: float) -> bpy.types.NodeSocket:
    """Grey 0.45 ± 0.4 of two crossed sines of ``turns`` radians per lens pitch, 20° from upright."""
    vector = object_vector(graph, Rotation=(0.0, math.radians(20), 0.0))
    parts = graph.node("ShaderNodeSeparateXYZ", {"Vector": vector})
    waves = [math_node(graph, "SINE", math_node(graph, "MULTIPLY", parts.outputs[axis], turns)) for axis in "XZ"]
    swing = math_node(graph, "MULTIPLY", math_node(graph, "MULTIPLY", *waves), 0.4)
    return math_node(graph, "ADD", swing, 0.45)


def math_node(graph: Graph, operation: str, *values: object) -> bpy.types.NodeSocket:
    """Result of one arithmetic node."""
    return graph.node("ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]


def depth_range(stage: Stage, usable: float) -> None:
    """Bodies from ``usable`` depths before the display to as many behind it, one behind another."""
    light()
    bodies(stage, stage.space.depth(-usable), stage.space.depth(usable), opaque_sorts())


def glass_scene(stage: Stage, material: bpy.types.Material, width: float = TILE) -> None:
    """Glass bodies about the display plane before a board of tiles ``width`` lenses wide."""
    light()
    space = stage.space
    bodies(stage, space.depth(-0.25), space.depth(0.25), [material] * 4, Grid(3.0))
    y = space.depth(BOARD_DEPTH)
    ground, graph, shader = principled("tiles", Roughness=0.8)
    size = (width * space.magnified(y),) * 2
    graph.feed(shader.inputs["Base Color"], tiles(graph, size, (0.08, 0.05, 0.2), (0.8, 0.7, 0.4)))
    full_board(stage, "tiles", y, ground)


def mirror(stage: Stage, usable: float) -> None:
    """A mirror at 45° through the display plane; what it shows hangs above it and is seen in it alone."""
    y = stage.space.depth(usable)
    half = [BIG * size for size in stage.space.window(stage.space.size[1])]
    glassy = paint("mirror", (0.95, 0.95, 0.95), 0.0, Metallic=1.0)
    turned(board("mirror", 0.0, (half[0], half[1] * math.sqrt(2)), glassy), (-45, 0, 0))
    width, height = (BIG * size for size in stage.space.window(y))
    shown = board("shown", 0.0, (width, height), glow("shown", lambda graph: print_of(graph, 0.5), MIRROR_GLOW))
    shown.location, shown.rotation_euler = (0.0, 0.0, y), (math.pi / 2, 0.0, 0.0)
    shown.visible_camera = False


def caustics(stage: Stage, degrees: float) -> None:
    """Glass balls and metal rings close before a white wall, lit by one lamp of a given size."""
    space, y = stage.space, stage.space.depth(0.5)
    world(strength=CAUSTIC_FILL)
    sun(2.5, math.radians(degrees))
    full_board(stage, "wall", y, paint("wall", (0.75, 0.72, 0.68), 1.0, Specular_IOR_Level=0.0))
    size = space.magnified(y)
    sorts = [glass(1.5, 0.0), paint("brass", (0.95, 0.75, 0.4), 0.05, Metallic=1.0)]
    bodies(stage, y - 2.2 * size, y - 1.6 * size, [sorts[0], sorts[0], sorts[1], sorts[0]], Grid(3.2))


def lamps(stage: Stage, pixels: float) -> None:
    """Small glowing balls among dark bodies in dim light."""
    world(strength=WORLD_STRENGTH / 4)
    space = stage.space
    bodies(stage, space.depth(0.3), space.depth(0.5), [  # that reflect a fiftieth of the light
        paint("soot", (0.02, 0.02, 0.02), 1.0, Specular_IOR_Level=0.0), paint("lacquer", (0.02, 0.01, 0.01), 0.1),
        paint("iron", (0.02, 0.02, 0.025), 0.4, Metallic=1.0), paint("navy", (0.01, 0.015, 0.04), 0.8)])
    radius = pixels * space.footprint(0)
    shine = glow("lamp", (1.0, 0.8, 0.5), LAMP_POWER / radius**2)
    ball = put(surfaces.sphere(), shine, (0, 0, 0), name="lamp")
    for place, _ in lattice(stage, space.depth(-0.2), space.depth(0.2), Grid(3.3)):
        again(ball, place, radius)
    bpy.data.objects.remove(ball)


def glitter(stage: Stage, per_lens: float) -> None:
    """Flakes of metal, turned at random, before dark felt under a small lamp."""
    world("studio", WORLD_STRENGTH / 4)
    sun(4.0, SUN)
    space = stage.space
    material = paint("metal", (0.95, 0.85, 0.6), 0.08, Metallic=1.0)
    put(flakes(stage, space.depth(-FLAKE_DEPTH), space.depth(FLAKE_DEPTH), FLAKE, per_lens), material, (0, 0, 0),
        name="flakes")
    full_board(stage, "felt", space.depth(FLAKE_DEPTH) + FLAKE, paint("felt", (0.05, 0.04, 0.09), 0.9))


def fraction(stage: Stage, lenses: float) -> None:
    """Bodies behind a card on the display plane whose hole is a block of lenses."""
    light()
    space = stage.space
    nearest = max(space.depth(0.1), 1.3)
    bodies(stage, nearest, max(space.depth(1), nearest), every_sort())
    columns, rows = hole(space.lenses, lenses)
    if (columns, rows) == space.lenses:
        return
    inner = []  # ends of the hole, across and upwards
    for total, open_, lens in zip(space.lenses, (columns, rows), space.lens, strict=True):
        first = (total - open_) // 2 - total / 2
        # The last row of pixels must not see past the edge through rounding.
        inner.append(((first + 1e-3) * lens, (first + open_ - 1e-3) * lens))
    (left, right), (low, high) = inner
    width, height = space.size
    corners = [(-width, -height), (width, -height), (width, height), (-width, height),
               (left, low), (right, low), (right, high), (left, high)]
    faces = np.array([[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)])
    card = Surface(np.array([(x, 0.0, z) for x, z in corners], float), faces, smooth=False)
    to_background(put(card, glow("card", (0.05, 0.05, 0.05), 1.0), (0, 0, 0), name="card"))


def background(stage: Stage, brightness: float) -> None:
    """Bodies of one grey before a plain board that is no foreground and ``brightness`` times as bright."""
    light()
    space = stage.space
    reach = (space.size[0] * 0.28, space.size[1] * 0.28)
    grey = [paint("grey", (0.5, 0.5, 0.5), 1.0, Specular_IOR_Level=0.0)] * 4
    bodies(stage, space.depth(-0.25), space.depth(0.25), grey, Grid(2.0, reach))
    shine = glow("ground", (1.0, 1.0, 1.0), GROUND * brightness)
    to_background(full_board(stage, "ground", space.depth(BOARD_DEPTH), shine))


def border(stage: Stage, contrast: float) -> None:
    """Glossy metal tiles of one lens each on the display plane: dark ones that stay, and brighter ones."""
    world(strength=2 * WORLD_STRENGTH)
    bright = DARK_TILE * (1 + contrast) / (1 - contrast)
    material, graph, shader = principled("tiles", Metallic=1.0, Roughness=0.12)
    # Edges of the tiles are edges of lenses, also where their number is odd.
    odd = tuple(0.5 * (count % 2) for count in stage.space.lenses)
    checker = tiles(graph, stage.space.lens, (DARK_TILE,) * 3, (bright,) * 3, (odd[0], 0.5, odd[1]))
    graph.feed(shader.inputs["Base Color"], checker)
    full_board(stage, "tiles", 0.0, material)


def motion(stage: Stage, lenses_per_frame: float) -> None:
    """A printed card that goes round a rectangle before bodies at rest; nothing stands between it and its light."""
    world()
    space, scene = stage.space, bpy.context.scene
    y, half, path = card_of_motion(space, int(lenses_per_frame), stage.frames)
    bodies(stage, max(space.depth(0.8), y + 2), max(space.depth(1), y + 2), opaque_sorts())
    card = board("card", y, half, printed("card", 1.5))
    scene.frame_start, scene.frame_end = 1, stage.frames
    for frame, place in enumerate(path, start=1):
        x, z = card_centre(space, y, place, path)
        card.location = (x, y, z)
        card.keyframe_insert("location", frame=frame)
    scene.frame_set(1)


def eye(stage: Stage, slope: float) -> None:
    """A printed board at the depth where neighbouring rendered views see points ``slope`` lenses apart."""
    world()
    y = stage.space.depth_of_slope(slope)
    full_board(stage, "print", y, printed("print", 0.6 / stage.space.magnified(y)))


def recall(stage: Stage, pixels: float) -> None:
    """Single bright specks before and behind the display plane."""
    world()
    space = stage.space
    speck = put(surfaces.sphere(), glow("speck", (1.0, 0.95, 0.85), 1.0), (0, 0, 0), name="speck")
    for place, _ in lattice(stage, space.depth(-0.5), space.depth(0.5), Grid(3.0)):
        again(speck, place, pixels * space.footprint(place[1]) / 2)
    bpy.data.objects.remove(speck)


def full_board(stage: Stage, name: str, y: float, material: bpy.types.Material) -> bpy.types.Object:
    """A board that fills every view."""
    width, height = stage.space.window(y)
    return board(name, y, (BIG * width, BIG * height), material)


BUILDERS: dict[str, Callable[[Stage, float], None]] = {
    "samples": samples, "depth-behind": depth, "depth-range": depth_range, "wire": wire, "texture": texture,
    "glass-texture": lambda stage, width: glass_scene(stage, glass(GLASS, 0.0), width),
    "glass-roughness": lambda stage, roughness: glass_scene(stage, glass(GLASS, roughness)), "mirror": mirror,
    "caustics": caustics, "lamps": lamps, "glitter": glitter, "share": fraction, "background": background,
    "border": border, "motion": motion, "eye": eye, "recall": recall}
