"""Six scenes that nothing was trained, tuned or chosen on, as .blend files, for one last measurement.

    python scripts/lab/lfsr_lab/scenes/unseen_scenes.py DIR

They are ``glitter``, ``cloth``, ``room``, ``city``, ``deep`` and ``world``; docs/results/networks.md says how they are
measured. Once their figures have led to a change of a method they are unseen no more: write others then.
"""

import math
import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
import numpy as np

from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import (
    again,
    demo_camera,
    lamp,
    paint,
    principled,
    put,
    save,
    script_paths,
    sun,
    world,
)

HALF_WIDTH, HALF_HEIGHT = 3.5, 2.0  # of the display
SUN = math.radians(0.5)  # across
Random = np.random.Generator
Vector = tuple[float, float, float]


def glitter(rng: Random) -> None:
    """Cut crystals and thin panes of glass, and chips of metal, under small lamps."""
    glass = paint("glass", (0.97, 0.99, 1.0), 0.0, Transmission_Weight=1.0, IOR=1.6)
    chips = paint("chips", (0.95, 0.85, 0.6), 0.08, Metallic=1.0)
    put(surfaces.card(), paint("felt", (0.05, 0.04, 0.09), 0.9), (0, 0.9, 0), (HALF_WIDTH, 1, HALF_HEIGHT))
    for index in range(7):
        put(surfaces.box(), glass, (-2.6 + 0.85 * index, 0.2 - 0.25 * (index % 3), 0.1), (0.03, 0.25, 1.2),
            (0, 0, rng.uniform(-0.7, 0.7)))
    crystal = put(_crystal(rng), glass, (0, -0.4, 0), 0.3)
    for _ in range(60):
        again(crystal, _within(rng, 0.9), rng.uniform(0.08, 0.26), _any_turn(rng))
    chip = put(surfaces.card(), chips, (0.4, 0.3, 0.4), 0.03)
    for _ in range(900):
        again(chip, _within(rng, 0.6), rng.uniform(0.015, 0.04), _any_turn(rng))
    for x in (-5.0, -1.0, 4.0):
        lamp((x, -6, 5), 260, 0.15)
    world("studio", 0.25)


def cloth(rng: Random) -> None:
    """Folded fabrics with woven print and a rug of fibres."""
    for index, color in enumerate([(0.55, 0.08, 0.06), (0.10, 0.22, 0.45), (0.70, 0.62, 0.45)]):
        put(surfaces.cloth(rng), _weave(f"cloth {index}", color, 30 + 25 * index), (-2.1 + 2.1 * index, 0.4, 0.35),
            (1.15, 1.0, 1.4))
    put(surfaces.box(), paint("floor", (0.25, 0.17, 0.11), 0.6), (0, 0, -1.75), (HALF_WIDTH, 1.2, 0.1))
    roots = np.column_stack([rng.uniform(-3.2, 3.2, 9000), rng.uniform(-1.1, 0.6, 9000), np.full(9000, -1.65)])
    lean = rng.normal(0, 0.08, (9000, 3)) * (1, 1, 0) + (0, 0, 0.35)
    paths = roots[:, None] + np.linspace(0, 1, 4)[None, :, None] * lean[:, None]
    put(surfaces.strands(paths, np.array([0.012, 0.011, 0.008, 0.002])),
        paint("wool", (0.6, 0.5, 0.36), 0.9, Sheen_Weight=0.6), (0, 0, 0))
    lamp((-5, -5, 5), 700, 2.0, (1.0, 0.93, 0.82))
    world("courtyard", 0.5)


def room(rng: Random) -> None:
    """A corner with shelves and vessels, lit through a window by one lamp and what it bounces."""
    wall, wood = paint("wall", (0.72, 0.68, 0.62), 0.8), paint("wood", (0.36, 0.20, 0.10), 0.45)
    for place, size in (((0, 2.2, 0), (4.5, 0.05, 2.6)), ((0, 0.2, -2.1), (4.5, 2.2, 0.05)),
                        ((0, 0.2, 2.4), (4.5, 2.2, 0.05)), ((4.2, 0.2, 0), (0.05, 2.2, 2.6))):
        put(surfaces.box(), wall, place, size)
    for level in (-0.9, 0.25, 1.4):
        put(surfaces.box(), wood, (0.6, 1.4, level), (2.6, 0.5, 0.05))
        for column in range(6):
            color = tuple(rng.uniform(0.05, 0.8, 3))
            put(surfaces.unit_sized(surfaces.lathe(rng)), paint("vessel", color, rng.uniform(0.1, 0.6)),
                (-1.5 + 0.85 * column, 1.3, level + 0.45), 0.36)
    put(surfaces.unit_sized(surfaces.blob(rng)), paint("chair", (0.15, 0.3, 0.25), 0.7), (-2.2, -0.3, -1.2), 0.9)
    lamp((-6, -1, 2.5), 900, 1.2, (1.0, 0.9, 0.75))
    world("interior", 0.15)


def city(rng: Random) -> None:
    """Blocks with rows of windows under a hard sun, from before the display plane to far behind it."""
    walls = [_windows(f"facade {index}", tuple(rng.uniform(0.2, 0.6, 3)), 6 + 4 * index) for index in range(4)]
    put(surfaces.box(), paint("street", (0.12, 0.12, 0.13), 0.7), (0, 2, -1.95), (4.5, 4, 0.05))
    for row in range(6):
        for column in range(9):
            height, x = rng.uniform(0.4, 1.7), -3.4 + 0.85 * column + 0.3 * (row % 2)
            put(surfaces.box(), walls[rng.integers(4)], (x, -0.9 + row, height - 1.9), (0.28, 0.3, height))
    wire = surfaces.tube(np.column_stack([np.linspace(-3.6, 3.6, 40), np.full(40, -0.8),
                                          0.9 + 0.05 * np.linspace(-3, 3, 40) ** 2]), 0.008, 6)
    put(wire, paint("wire", (0.02, 0.02, 0.02)), (0, 0, 0))
    sun(4.0, SUN, (0.9, 0.15, 0.6))
    world("city", 0.6)


def deep(rng: Random) -> None:
    """Printed posts and plants in rows from well before the display plane to well behind it."""
    print_ = _weave("print", (0.8, 0.35, 0.1), 14)
    leaf = paint("leaf", (0.12, 0.35, 0.08), 0.4)
    for index, depth in enumerate(np.linspace(-2.5, 5.0, 9)):
        x = -2.8 + 0.7 * index
        put(surfaces.box(), print_, (x, depth, -0.4), (0.18, 0.18, 1.3), (0, 0, rng.uniform(0, 1.5)))
        blades = rng.normal(0, 1, (120, 3)) * (0.4, 0.4, 0.3) + (0, 0, 0.8)
        paths = np.array([x + 0.35, depth, -1.7]) + np.linspace(0, 1, 5)[None, :, None] ** (1, 1, 0.8) * blades[:, None]
        put(surfaces.strands(paths, np.array([0.02, 0.03, 0.03, 0.02, 0.004])), leaf, (0, 0, 0))
    put(surfaces.terrain(rng), paint("earth", (0.3, 0.22, 0.14), 0.9), (0, 1.2, -1.85), (4.2, 4.5, 0.3))
    sun(3.0, SUN, (0.7, -0.3, 0.4))
    world("forest", 0.8)


def around(rng: Random) -> None:
    """A metal knot, a glass ball and a thin plant before a landscape that is seen."""
    put(surfaces.unit_sized(surfaces.torus_knot(rng)), paint("copper", (0.9, 0.5, 0.3), 0.15, Metallic=1.0),
        (-1.5, 0.1, 0.0), 1.2)
    put(surfaces.sphere(), paint("glass", (1, 1, 1), 0.0, Transmission_Weight=1.0, IOR=1.45), (1.6, -0.3, -0.5), 0.8)
    twigs = rng.normal(0, 1, (160, 3)) * (0.8, 0.5, 0.4) + (0, 0, 1.3)
    paths = np.array([1.7, 0.6, -1.4]) + np.linspace(0, 1, 5)[None, :, None] ** (1.6, 1.6, 0.8) * twigs[:, None]
    put(surfaces.strands(paths, np.array([0.02, 0.015, 0.012, 0.008, 0.003])), paint("twig", (0.2, 0.11, 0.05), 0.8),
        (0, 0, 0))
    world("sunset", 1.0)
    bpy.context.scene.render.film_transparent = False


def _any_turn(rng: Random) -> Vector:
    return tuple(rng.uniform(0, 2 * math.pi, 3))


def _within(rng: Random, depth: float) -> Vector:
    """A place that the display shows, within ``depth`` of its plane."""
    return tuple(rng.uniform(-1, 1, 3) * (HALF_WIDTH - 0.4, depth, HALF_HEIGHT - 0.4))


def _crystal(rng: Random) -> surfaces.Surface:
    """A six-sided rod with pointed ends, flat facets."""
    height, radius = np.array([-1.0, -0.7, 0.6, 1.0])[:, None], np.array([0.0, 0.35, 0.35, 0.0])[:, None]
    angle = np.linspace(0, 2 * math.pi, 7)[None] + rng.uniform(0, 1)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height + 0 * angle], -1)
    rows, columns = np.indices((3, 6))
    corner = (rows * 7 + columns).ravel()
    faces = np.stack([corner, corner + 1, corner + 8, corner + 7], -1)
    return surfaces.Surface(points.reshape(-1, 3), faces, smooth=False)


def _weave(name: str, color: Vector, threads: float) -> bpy.types.Material:
    """Checks of two tones of a colour, ``threads`` along each side of the texture square."""
    material, graph, shader = principled(name)
    dark = tuple(0.35 * value for value in color)
    checks = graph.node("ShaderNodeTexChecker", {"Color1": (*color, 1), "Color2": (*dark, 1), "Scale": threads,
                                                 "Vector": graph.node("ShaderNodeTexCoord").outputs["UV"]})
    graph.feed(shader.inputs["Base Color"], checks.outputs["Color"])
    shader.inputs["Roughness"].default_value = 0.85
    return material


def _windows(name: str, color: Vector, count: float) -> bpy.types.Material:
    """A facade with ``count`` windows along each side: darker and smoother than the wall."""
    material, graph, shader = principled(name)
    bricks = graph.node("ShaderNodeTexBrick", {"Color1": (0.03, 0.05, 0.08, 1), "Color2": (0.5, 0.42, 0.25, 1),
                                               "Mortar": (*color, 1), "Scale": count, "Mortar Size": 0.06,
                                               "Vector": graph.node("ShaderNodeTexCoord").outputs["UV"]})
    graph.feed(shader.inputs["Base Color"], bricks.outputs["Color"])
    graph.feed(shader.inputs["Roughness"], bricks.outputs["Fac"])
    return material


BUILDERS = {"glitter": glitter, "cloth": cloth, "room": room, "city": city, "deep": deep, "world": around}


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for number, (name, build) in enumerate(BUILDERS.items()):
        demo_camera()
        build(np.random.default_rng([17, number]))
        save(folder / f"{name}.blend")


if __name__ == "__main__":
    main(**script_paths(__doc__, folder="DIR"))
