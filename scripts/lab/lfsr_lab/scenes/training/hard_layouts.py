"""Layouts where denoisers fail: glass before texture, glitter, crowds, thin and deep parts, signs, interiors, hair."""

from __future__ import annotations

import math

import bpy
import numpy as np

from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import add_surface, principled, settle
from lfsr_lab.scenes.training import shapes
from lfsr_lab.scenes.training.layouts import around_plane, backdrop, floor_at, rods, room_side, scatter
from lfsr_lab.scenes.training.lights import glowing_ball, light_dark, light_room
from lfsr_lab.scenes.training.materials import paper_material, random_color, random_material
from lfsr_lab.scenes.training.shapes import copies, kinds, put, random_shape, readable, turn, upright
from lfsr_lab.scenes.training.stage import Stage


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
        thing = random_shape(stage, kind, _light_tube(stage)) if kind != "screen" else \
            add_surface(surfaces.card(), random_material(stage, kind="glow"), "screen")
        at, size = stage.place(0.6), stage.rng.uniform(0.15, 0.7)
        put(stage, thing, at, size, readable(stage) if kind == "text" else stage.rng.normal(0, 0.3, 3))
    scatter(stage, (1, 6), 0.7, (0.15, 0.5))
    if stage.chance(0.6):
        floor_at(stage, -stage.array.half_height * 0.8)
    if stage.chance(0.4):
        backdrop(stage)
    light_dark(stage, lamps=0)


def _light_tube(stage: Stage) -> bpy.types.Material:
    material, _, shader = principled("sign", Emission_Color=random_color(stage, 0.5, 1),
                                     Emission_Strength=stage.log_uniform(1, 30))
    stage.dimmers.append((shader.inputs["Emission Strength"], "default_value"))
    return material


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
        material = _hair_material(stage) if stage.chance(0.6) else random_material(stage, closed=False)
        size = stage.rng.uniform(0.2, 0.8)
        put(stage, add_surface(fur, material, "hair"), around_plane(stage, size), size)
    scatter(stage, (0, 3), 0.7, (0.1, 0.4))


def _hair_material(stage: Stage) -> bpy.types.Material:
    material, graph, _ = principled("hair")
    shader = graph.node("ShaderNodeBsdfHairPrincipled", {"Roughness": float(stage.rng.uniform(0.1, 0.5)),
                                                         "Color": random_color(stage, 0.05, 0.8)})
    shader.parametrization = "COLOR"
    graph.feed(graph.only("OUTPUT_MATERIAL").inputs["Surface"], shader.outputs[0])
    stage.note("material", kind="hair")
    return material


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


LAYOUTS = {"window": (9, window), "sparkle": (8, sparkle), "crowd": (11, crowd), "thin": (8, thin), "signs": (7, signs),
           "interior": (13, interior), "hair": (5, hair)}
LIT = ("signs", "interior")  # layouts that bring their own light
