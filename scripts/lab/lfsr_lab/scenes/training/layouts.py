"""How objects are arranged: one hero, piles, clouds, rooms, streets, gardens, sheets."""

from __future__ import annotations

import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import add_surface, principled, settle
from lfsr_lab.scenes.training import shapes
from lfsr_lab.scenes.training.materials import (
    glowing_ball,
    leaf_material,
    light_dark,
    light_room,
    paper_material,
    random_color,
    random_material,
)
from lfsr_lab.scenes.training.shapes import CLOSED, SMALL, copies, kinds, put, random_shape, readable, turn, upright
from lfsr_lab.scenes.training.stage import Stage


def around_plane(stage: Stage, size: float) -> Array:
    """Return a place near the middle where an object of this half-size stays within the depth limits."""
    low, high = min(size * 0.8 - stage.front, 0), max(stage.behind - size * 0.8, 0)
    return np.array([stage.rng.normal(0, 0.2), stage.rng.uniform(low, high) * 0.7, stage.rng.normal(0, 0.12)])


def hero(stage: Stage) -> None:
    """One object, as in most of the test renders, sometimes on a plinth or with companions."""
    alone = stage.chance(0.55)
    size = stage.rng.uniform(0.2, 0.95)
    at = around_plane(stage, size)
    thing = random_shape(stage)
    put(stage, thing, at, size, readable(stage) if thing.type == "FONT" else upright(stage, 0.4))
    if not alone and stage.chance(0.6):
        below = surfaces.box(stage.rng.uniform(0.5, 1.5), stage.rng.uniform(0.3, 1), 0.06)
        put(stage, add_surface(below, random_material(stage), "plinth"), at - [0, 0, size], 1.0, np.zeros(3))
    if not alone:
        scatter(stage, (1, 4), 0.9, (0.08, 0.3))


def scatter(stage: Stage, counts: tuple[int, int], margin: float, sizes: tuple[float, float]) -> None:
    """Random objects in the viewing frustum."""
    for _ in range(stage.rng.integers(*counts)):
        put(stage, random_shape(stage), stage.place(margin), stage.rng.uniform(*sizes))


def assembly(stage: Stage) -> None:
    """Parts grown onto each other in a few materials, as a figure, a helmet or a machine."""
    size = stage.rng.uniform(0.12, 0.4)
    grown = [(around_plane(stage, 2 * size), size)]
    materials = [random_material(stage) for _ in range(stage.rng.integers(1, 5))]
    for _ in range(stage.rng.integers(3, 16)):
        at, parent = grown[stage.rng.integers(len(grown))]
        along = stage.rng.normal(size=3)
        grown.append((at + along / np.linalg.norm(along) * parent * 0.8, parent * stage.rng.uniform(0.4, 1)))
    for at, part in grown:
        kind = stage.pick({name: weight for name, weight in SMALL.items() if name in CLOSED})
        put(stage, random_shape(stage, kind, materials[stage.rng.integers(len(materials))]), at, part)


def pile(stage: Stage) -> None:
    """Clutter of many objects of few kinds, on a floor or floating."""
    bodies = [random_shape(stage, stage.pick(kinds(stage, small=True))) for _ in range(stage.rng.integers(3, 7))]
    floor, largest = -stage.array.half_height * stage.rng.uniform(0.5, 0.9), stage.rng.uniform(0.12, 0.35)
    spread = stage.rng.uniform(0.25, 0.9)
    for thing in copies(stage, bodies, 15, 90):
        size = largest * stage.rng.uniform(0.3, 1)
        at = stage.place(spread)
        at[2] = floor + size * stage.rng.uniform(0.6, 1) + abs(stage.rng.normal(0, 0.3))
        put(stage, thing, at, size)
    if stage.chance(0.7):
        floor_at(stage, floor)


def cloud(stage: Stage) -> None:
    """Particles of one or two kinds all through the depth range."""
    bodies = [random_shape(stage, stage.pick({"ball": 4, "box": 2, "rock": 2, "knot": 1, "blob": 2}))
             for _ in range(stage.rng.integers(1, 4))]
    size, spread = stage.log_uniform(0.015, 0.12), stage.rng.uniform(0.3, 1.1)
    for thing in copies(stage, bodies, 60, 400):
        at, turned = stage.place(spread), turn(stage)
        settle(thing, at, size * stage.rng.uniform(0.4, 1.5), turned)
    stage.note("cloud", size=size)
    if stage.chance(0.4):
        hero(stage)


def wires(stage: Stage) -> None:
    """Thin wires, springs, lattices and rods crossing the view."""
    for _ in range(stage.rng.integers(2, 8)):
        kind = stage.pick({"wire": 5, "spring": 2, "lattice": 3, "knot": 1})
        put(stage, random_shape(stage, kind), stage.place(0.6), stage.rng.uniform(0.3, 1))
    rods(stage, (0, 16), (0.004, 0.03))


def rods(stage: Stage, counts: tuple[int, int], radii: tuple[float, float]) -> None:
    """Straight rods of one material crossing the view."""
    material = random_material(stage, closed=False)
    for _ in range(stage.rng.integers(*counts)):
        first, last = stage.place(1.2), stage.place(1.2)
        add_surface(surfaces.tube(np.linspace(first, last, 8), stage.log_uniform(*radii), 8), material, "rod")


def woods(stage: Stage) -> None:
    """One tree, or a few; leaves cut out by alpha."""
    for _ in range(stage.rng.integers(1, 4)):
        plant = shapes.tree(stage.rng)
        size = stage.rng.uniform(0.5, 1.0)
        _plant(stage, plant, (around_plane(stage, size * 0.6), size, upright(stage, 0.1)))
    if stage.chance(0.3):
        floor_at(stage, -stage.array.half_height * 0.9)


def _plant(stage: Stage, plant: shapes.Plant, where: tuple[Array, float, Array], cut_out: bool = True) -> None:
    """Wood and leaves; ``where``: place, size and turn, as of ``put``; ``cut_out``: leaves drawn by alpha."""
    wood, leaves = plant
    put(stage, add_surface(wood, random_material(stage, closed=False), "wood"), *where)
    if leaves is not None:
        material = leaf_material(stage) if cut_out else random_material(stage, closed=False)
        put(stage, add_surface(leaves, material, "leaves"), *where)


def bouquet(stage: Stage) -> None:
    """Flowers in a vessel, mostly of glass, sometimes with water or marbles."""
    size = stage.rng.uniform(0.3, 0.5)
    base = around_plane(stage, size) - [0, 0, 0.35]
    kind = stage.pick({"glass": 7, "any": 3})
    vase = random_shape(stage, "lathe", random_material(stage, kind="glass") if kind == "glass" else None)
    put(stage, vase, base, size, np.array([0, 0, 0.0]))
    for _ in range(stage.rng.integers(2, 10)):
        lean = np.array([*stage.rng.normal(0, 0.25, 2), stage.rng.uniform(-3, 3)])
        height = size * stage.rng.uniform(0.9, 1.5)
        _plant(stage, shapes.flower(stage.rng), (base + np.array([0, 0, height - size]), height, lean),
               cut_out=stage.chance(0.2))
    if stage.chance(0.5):
        floor_at(stage, base[2] - size)


def meadow(stage: Stage) -> None:
    """Grass or hair-like blades with a few objects among them."""
    floor = -stage.array.half_height * 0.7
    blades = shapes.grass(stage.rng, 1.4, (stage.front + stage.behind) / 2)
    middle = np.array([0, (stage.behind - stage.front) / 2, floor])
    put(stage, add_surface(blades, random_material(stage, closed=False), "grass"), middle, 1.0, np.zeros(3))
    scatter(stage, (0, 5), 0.7, (0.1, 0.4))
    if stage.chance(0.8):
        floor_at(stage, floor)


def sheets(stage: Stage) -> None:
    """Photographs on cards and cloths at many depths, some torn."""
    for _ in range(stage.rng.integers(2, 9)):
        flat = stage.chance(0.6)
        surface = surfaces.card(1, stage.rng.uniform(0.5, 1.3)) if flat else surfaces.cloth(stage.rng)
        material = paper_material(stage, stage.chance(0.35)) if flat or stage.chance(0.5) else \
            random_material(stage, closed=False, kind="cloth")
        put(stage, add_surface(surface, material, "sheet"), stage.place(0.8), stage.rng.uniform(0.2, 0.9),
            stage.rng.normal(0, 0.5, 3))


def wall(stage: Stage) -> None:
    """A textured wall, relief or landscape behind everything, and objects before it: every lens sees something."""
    backdrop(stage)
    scatter(stage, (1, 7), 0.8, (0.12, 0.5))


def street(stage: Stage) -> None:
    """Architecture: rows of boxes and columns with windows, on a ground."""
    floor, materials = -stage.array.half_height * 0.8, [random_material(stage) for _ in range(4)]
    for _ in range(stage.rng.integers(8, 40)):
        at = stage.place(1.2)
        half = stage.rng.uniform(0.05, 0.25, 2)
        height = stage.log_uniform(0.1, 0.8)
        body = surfaces.box(half[0], half[1], height) if stage.chance(0.8) else surfaces.revolve(
            np.full(8, half[0]), np.linspace(-height, height, 8), 0.02, 32)
        at[2] = floor + height
        put(stage, add_surface(body, materials[stage.rng.integers(4)], "house"), at, 1.0,
            np.array([0, 0, stage.rng.choice([0, 0.3, 0.8])]))
    floor_at(stage, floor)
    if stage.chance(0.4):
        backdrop(stage)


def room(stage: Stage) -> None:
    """A box seen from its open side or from inside, with furniture; every lens sees something."""
    width, height = (1.02 * side for side in stage.window(0.0))
    behind = max(stage.behind, 0.5)
    is_closed = stage.chance(0.4) and stage.camera_reach <= min(width, height)
    front = stage.array.distance + 0.3 if is_closed else stage.rng.uniform(0, 0.3)
    half = np.array([width * stage.rng.uniform(1, 1.3), (behind + front) / 2, height * stage.rng.uniform(1, 1.3)])
    middle = np.array([0, (behind - front) / 2, 0])
    for axis, side in ((0, -1), (0, 1), (1, 1), (1, -1), (2, -1), (2, 1)):
        if (axis, side) != (1, -1) or front > 1:
            room_side(stage, middle, half, axis, side)
    for _ in range(stage.rng.integers(2, 9)):
        size = stage.rng.uniform(0.12, 0.45)
        at = middle + half * stage.rng.uniform(-0.75, 0.75, 3)
        at[1] = np.clip(at[1], -stage.front, behind - size)
        at[2] = middle[2] - half[2] + size * 0.8 if stage.chance(0.7) else at[2]
        kind = stage.pick(kinds(stage, small=True) | {"box": 25})
        put(stage, random_shape(stage, kind), at, size, upright(stage, 0.05))
    light_room(stage, middle, half)


def room_side(stage: Stage, middle: Array, half: Array, axis: int, side: int) -> None:
    extent = half.copy()
    extent[axis] = 0.02
    at = middle.copy()
    at[axis] += side * (half[axis] + 0.02)
    kind = stage.pick({"plastic": 5, "photo": 3, "noise": 2, "lacquer": 1, "metal": 0.5})
    put(stage, add_surface(surfaces.box(*extent), random_material(stage, kind=kind), "side"), at, 1.0, np.zeros(3))


def floor_at(stage: Stage, height: float) -> None:
    """Ground between the depth limits: flat or rolling."""
    middle = np.array([0, (stage.behind - stage.front) / 2, height])
    half = np.array([stage.rng.uniform(0.9, 2.5), (stage.front + stage.behind) / 2, 1.0])
    ground = surfaces.terrain(stage.rng) if stage.chance(0.4) else surfaces.box(1, 1, 0.02)
    put(stage, add_surface(ground, random_material(stage, closed=False), "floor"), middle, half, np.zeros(3))


def backdrop(stage: Stage) -> None:
    """A wall across the whole view at the far limit: photograph, material or relief."""
    depth = max(stage.behind * stage.rng.uniform(0.5, 1), 0.1)
    width, height = stage.window(depth, 1.0)
    size = np.array([width, 1.0, height]) * 1.1
    if stage.chance(0.5):
        surface, tilt = surfaces.card(), stage.rng.normal(0, 0.08, 3)
        material = paper_material(stage, False) if stage.chance(0.7) else random_material(stage, closed=False)
    else:
        surface, tilt = surfaces.terrain(stage.rng), np.array([math.pi / 2, 0, 0])
        material, size = random_material(stage, closed=False), size[[0, 2, 1]]
    put(stage, add_surface(surface, material, "backdrop"), np.array([0, depth, 0]), size, tilt)


def window(stage: Stage) -> None:
    """Glass objects and panes before a textured wall or before printed cards."""
    backdrop(stage)
    for _ in range(stage.rng.integers(0, 4)):
        put(stage, add_surface(surfaces.card(), paper_material(stage, False), "card"), stage.place(0.7),
            stage.rng.uniform(0.3, 0.8), stage.rng.normal(0, 0.3, 3))
    for _ in range(stage.rng.integers(1, 7)):
        glass = random_material(stage, kind="glass")
        if stage.chance(0.35):
            pane = surfaces.box(stage.rng.uniform(0.3, 1), stage.rng.uniform(0.01, 0.08), stage.rng.uniform(0.3, 1))
            put(stage, add_surface(pane, glass, "pane"), around_plane(stage, 0.1), 1.0, stage.rng.normal(0, 0.4, 3))
        else:
            kind = stage.pick({"lathe": 4, "ball": 3, "blob": 3, "knot": 2, "rock": 3, "monkey": 1})
            size = stage.rng.uniform(0.15, 0.7)
            put(stage, random_shape(stage, kind, glass), around_plane(stage, size), size)


def sparkle(stage: Stage) -> None:
    """Chips of metal and glass, facets and tiny lamps, with or without an object among them."""
    chips = []
    for _ in range(stage.rng.integers(1, 4)):
        material, _, _ = principled("chip", Base_Color=random_color(stage, 0.3, 0.95), Metallic=1.0,
                                    Roughness=float(stage.rng.choice([0.02, 0.08, 0.2])))
        material = random_material(stage, kind="glass") if stage.chance(0.25) else material
        chips.append(random_shape(stage, "rock", material) if stage.chance(0.4) else
                     add_surface(surfaces.box(1, 0.05, 1), material, "chip"))
    size, spread = stage.log_uniform(0.01, 0.08), stage.rng.uniform(0.3, 1)
    for chip in copies(stage, chips, 80, 700):
        settle(chip, stage.place(spread), size * stage.rng.uniform(0.4, 1.6), turn(stage))
    for _ in range(stage.rng.integers(0, 25)):
        glowing_ball(stage, stage.log_uniform(0.004, 0.02))
    if stage.chance(0.6):
        put(stage, random_shape(stage), around_plane(stage, 0.4), stage.rng.uniform(0.2, 0.6))
    if stage.chance(0.4):
        floor_at(stage, -stage.array.half_height * 0.8)


def crowd(stage: Stage) -> None:
    """Rows or a swarm of many small figures of a few kinds."""
    figures = [random_shape(stage, stage.pick(kinds(stage, small=True) | {"text": 5}))
               for _ in range(stage.rng.integers(2, 7))]
    floor = -stage.array.half_height * stage.rng.uniform(0.3, 0.8)
    size = min(stage.log_uniform(1, 5) * 2 / stage.profile.lenses[0], 0.3)
    is_standing = stage.chance(0.75)
    for figure in copies(stage, figures, 40, 260):
        at = stage.place(1.1)
        at[2] = floor + size * 0.8 if is_standing else at[2]
        turned = readable(stage) if figure.type == "FONT" else upright(stage, 0.05) if is_standing else turn(stage)
        settle(figure, at, size * stage.rng.uniform(0.7, 1.2), turned)
    if is_standing:
        floor_at(stage, floor)


def thin(stage: Stage) -> None:
    """Wires, blades and lattices up to three times deeper than views can follow."""
    limits = stage.front, stage.behind
    stage.front, stage.behind = min(stage.front * 3, 0.7 * stage.array.distance), stage.behind * 3
    for _ in range(stage.rng.integers(3, 10)):
        kind = stage.pick({"wire": 4, "spring": 2, "lattice": 4, "knot": 1, "text": 1, "fur": 1})
        at = stage.place(0.8)
        at[1] = stage.rng.choice([-stage.front, stage.behind]) * stage.rng.uniform(0.3, 1)
        put(stage, random_shape(stage, kind), at, stage.rng.uniform(0.2, 0.9))
    rods(stage, (4, 30), (0.003, 0.02))
    stage.front, stage.behind = limits
    if stage.chance(0.5):
        put(stage, random_shape(stage), around_plane(stage, 0.4), stage.rng.uniform(0.2, 0.6))


def signs(stage: Stage) -> None:
    """Glowing letters, tubes and screens in the dark, over objects that they light."""
    for _ in range(stage.rng.integers(1, 6)):
        kind = stage.pick({"text": 5, "wire": 2, "knot": 1, "spring": 1, "screen": 2})
        if kind == "screen":
            thing = add_surface(surfaces.card(), random_material(stage, kind="glow"), "screen")
        else:
            tube, _, shader = principled("sign", Emission_Color=random_color(stage, 0.5, 1),
                                         Emission_Strength=stage.log_uniform(1, 30))
            stage.dimmers.append((shader.inputs["Emission Strength"], "default_value"))
            thing = random_shape(stage, kind, tube)
        at, size = stage.place(0.6), stage.rng.uniform(0.15, 0.7)
        put(stage, thing, at, size, readable(stage) if kind == "text" else stage.rng.normal(0, 0.3, 3))
    scatter(stage, (1, 6), 0.7, (0.15, 0.5))
    if stage.chance(0.6):
        floor_at(stage, -stage.array.half_height * 0.8)
    if stage.chance(0.4):
        backdrop(stage)
    light_dark(stage, lamps=0)


def interior(stage: Stage) -> None:
    """A room with furniture and pictures, closed where the cameras fit into it; every lens sees something."""
    behind, front = max(stage.behind, 0.6), stage.rng.uniform(0.05, 0.5)
    least = stage.window(-front, 1.0)  # else cameras see the walls from outside
    width, height = (max(side * stage.rng.uniform(1.02, 1.5), most) for side, most in
                     zip(stage.window(0.0), least, strict=True))
    is_closed = stage.camera_reach < min(width, height)
    front = stage.array.distance + 0.4 if is_closed else front
    middle, half = np.array([0, (behind - front) / 2, 0]), np.array([width, (behind + front) / 2, height])
    for axis in range(3):
        for side in (-1, 1):
            if (axis, side) != (1, -1) or is_closed:
                room_side(stage, middle, half, axis, side)
    for _ in range(stage.rng.integers(3, 12)):
        size = stage.rng.uniform(0.2, 0.7)
        at = np.array([stage.rng.uniform(-0.85, 0.85) * width, stage.rng.uniform(-stage.front, behind - size * 0.7),
                       size * 0.7 - height])
        turned = np.array([0, 0, stage.rng.choice([0, 0.5, 1, 1.5]) * math.pi + stage.rng.normal(0, 0.15)])
        put(stage, random_shape(stage, stage.pick(kinds(stage, small=True))), at, size, turned)
    for _ in range(stage.rng.integers(0, 4)):
        at = np.array([stage.rng.uniform(-0.7, 0.7) * width, behind - 0.03, stage.rng.uniform(-0.3, 0.6) * height])
        put(stage, add_surface(surfaces.card(), paper_material(stage, False), "picture"), at,
            stage.rng.uniform(0.1, 0.3), np.zeros(3))
    middle[1], half[1] = behind - 1.2, 1.2  # lamps where they are seen to shine
    if stage.chance(0.7):
        light_room(stage, middle, half)
    else:
        light_dark(stage, lamps=1, reach=0.8 * float(min(width, height)))


def hair(stage: Stage) -> None:
    """Furs and brushes of thin hairs, in hair or any other material."""
    for _ in range(stage.rng.integers(1, 4)):
        body = surfaces.blob(stage.rng) if stage.chance(0.5) else surfaces.sphere(40, 24)
        fur = surfaces.unit_sized(shapes.fur(stage.rng, body, 4, 0.4))
        if stage.chance(0.6):
            material, graph, _ = principled("hair")
            shader = graph.node("ShaderNodeBsdfHairPrincipled", {"Roughness": float(stage.rng.uniform(0.1, 0.5)),
                                                                 "Color": random_color(stage, 0.05, 0.8)})
            shader.parametrization = "COLOR"
            graph.feed(graph.only("OUTPUT_MATERIAL").inputs["Surface"], shader.outputs[0])
            stage.note("material", kind="hair")
        else:
            material = random_material(stage, closed=False)
        size = stage.rng.uniform(0.2, 0.8)
        put(stage, add_surface(fur, material, "hair"), around_plane(stage, size), size)
    scatter(stage, (0, 3), 0.7, (0.1, 0.4))


def fog(stage: Stage) -> None:
    """Even fog all through the depth range."""
    material, graph, shader = principled("fog")
    graph.tree.nodes.remove(shader)
    depth = stage.front + stage.behind
    density = stage.log_uniform(0.15, 1.5) / depth
    scatter = graph.node("ShaderNodeVolumeScatter", {"Color": random_color(stage, 0.6, 1), "Density": density,
                                                     "Anisotropy": float(stage.rng.uniform(-0.2, 0.7))})
    graph.feed(graph.only("OUTPUT_MATERIAL").inputs["Volume"], scatter.outputs[0])
    width, height = stage.window(stage.behind, 1.0)
    settle(add_surface(surfaces.box(width * 1.2, depth / 2, height * 1.2), material, "fog"),
           np.array([0, (stage.behind - stage.front) / 2, 0]), 1.0, np.zeros(3))
    stage.note("fog", density=density)


LAYOUTS = {"hero": (20, hero), "assembly": (11, assembly), "pile": (13, pile), "cloud": (8, cloud),
           "wires": (7, wires), "woods": (9, woods), "bouquet": (8, bouquet), "meadow": (4, meadow),
           "sheets": (8, sheets), "wall": (7, wall), "street": (5, street), "room": (10, room),
           "window": (9, window), "sparkle": (8, sparkle), "crowd": (11, crowd), "thin": (8, thin), "signs": (7, signs),
           "interior": (13, interior), "hair": (5, hair)}
LIT = ("signs", "interior")  # layouts that bring their own light
