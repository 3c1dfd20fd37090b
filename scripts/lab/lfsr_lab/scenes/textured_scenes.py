"""Ten scenes of photographs, depth, glass, metal and hair, as .blend files, by which pooling along depth was judged.

    python scripts/lab/lfsr_lab/scenes/textured_scenes.py PHOTOGRAPHS DIR

PHOTOGRAPHS: the Kodak images. The figures: docs/results/pooling.md. No constant of it was fitted to them.
"""

import math
import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
import numpy as np

from lfsr_lab.scenes.shared import surfaces as shapes
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

Random = np.random.Generator


def glass(name: str, refraction: float = 1.45) -> bpy.types.Material:
    return paint(name, (0.97, 0.99, 1.0), 0.0, Transmission_Weight=1.0, IOR=refraction)


class Scenes:
    """Builders of the scenes, by name."""

    def __init__(self, photographs: Path) -> None:
        self._files = sorted(photographs.glob("*.png"))

    def _photograph(self, number: int, roughness: float = 0.6) -> bpy.types.Material:
        material, graph, shader = principled(f"photograph {number}", Roughness=roughness)
        place = graph.node("ShaderNodeTexCoord").outputs["UV"]
        texture = graph.node("ShaderNodeTexImage", {"Vector": place}, image=bpy.data.images.load(
            str(self._files[number % len(self._files)])))
        graph.feed(shader.inputs["Base Color"], texture.outputs["Color"])
        return material

    def pane(self, _rng: Random) -> None:
        """A pane and a ball of clear glass before a photograph."""
        put(shapes.card(), self._photograph(0), (0, 1.2, 0), (4.2, 1, 2.5))
        put(shapes.box(), glass("pane"), (-1.6, -0.3, 0.1), (1.1, 0.04, 1.3))
        put(shapes.sphere(), glass("ball", 1.5), (1.7, -0.2, -0.3), 0.8)
        put(shapes.box(), paint("post", (0.5, 0.2, 0.1)), (0.2, -0.5, -0.6), (0.15, 0.15, 1.2))
        sun(2.0, 0.03, (0.6, 0.1, 0.3))
        world("city", 0.6)

    def print(self, rng: Random) -> None:
        """A photograph far before the display plane; what stands behind it shows beside it."""
        put(shapes.card(), paint("mirror", (0.95, 0.95, 0.95), 0.0, Metallic=1.0), (0, 0.9, 0.2), (3.2, 1, 1.8))
        put(shapes.card(), self._photograph(3), (0, -6, 0), (5, 1, 3), (0, 0, math.pi))
        for index in range(5):
            put(shapes.unit_sized(shapes.lathe(rng)), paint(f"vase {index}", tuple(rng.uniform(0.1, 0.8, 3)), 0.3),
                (-2.6 + 1.3 * index, rng.uniform(-0.4, 0.4), -1.0), 0.55)
        put(shapes.box(), paint("table", (0.3, 0.2, 0.12), 0.5), (0, 0.2, -1.8), (4, 1.4, 0.1))
        lamp((-3, -4, 4), 600, 1.0)
        world("interior", 0.4)

    def hall(self, _rng: Random) -> None:
        """A corridor of columns and photographs, far deeper than the display shows."""
        for x in (-4.2, 4.2):
            put(shapes.box(), paint("wall", (0.7, 0.66, 0.6), 0.8), (x, 5, 0), (0.1, 9, 2.5))
        for z in (-2.4, 2.4):
            put(shapes.box(), paint("floor", (0.45, 0.35, 0.25), 0.5), (0, 5, z), (4.2, 9, 0.05))
        profile = np.array([0.3, 0.2, 0.2, 0.3]), np.array([-1.0, -0.8, 0.8, 1.0]), 0.05
        for index in range(6):
            for x in (-2.6, 2.6):
                put(shapes.unit_sized(shapes.revolve(*profile)), paint("column", (0.6, 0.58, 0.55), 0.5),
                    (x, -0.8 + 2.0 * index, 0), 2.1)
            put(shapes.card(), self._photograph(4 + index), (-4.05, -0.2 + 2 * index, 0.3), (0.8, 1, 0.6),
                (0, 0, math.pi / 2))
            lamp((0, 1 + 2 * index, 2.2), 60, 0.5)
        put(shapes.card(), self._photograph(11), (0, 13, 0), (3, 1, 2))
        world("interior", 0.1)

    def street(self, rng: Random) -> None:
        """Two rows of printed houses, lamp posts and cars under a hard sun."""
        put(shapes.box(), paint("road", (0.1, 0.1, 0.11), 0.6), (0, 5, -2), (6, 8, 0.05))
        for side in (-1, 1):
            for index in range(6):
                put(shapes.box(), self._photograph(12 + index),
                    (side * (3.2 + rng.uniform(0, 0.5)), -0.5 + 2.0 * index, rng.uniform(-1, 0)),
                    (0.8, 0.9, rng.uniform(1, 2.4)))
            for index in range(5):
                path = np.array([[1.9 * side, 1.8 * index, -2.0], [1.9 * side, 1.8 * index, 1.0],
                                 [1.5 * side, 1.8 * index, 1.2]])
                put(shapes.tube(path, 0.03), paint("post", (0.05, 0.05, 0.05)), (0, 0, 0))
        for index in range(4):
            color = tuple(rng.uniform(0.1, 0.8, 3))
            put(shapes.unit_sized(shapes.superquadric(rng)), paint(f"car {index}", color, 0.2),
                (rng.uniform(-1.2, 1.2), 1.7 * index, -1.6), 0.45)
        sun(3.5, 0.01, (0.8, 0.2, 0.4))
        world("city", 0.7)

    def hair(self, rng: Random) -> None:
        """Three balls of four thousand strands each."""
        for x in (-1.9, 0.0, 1.9):
            away = rng.normal(size=(4000, 3))
            away /= np.linalg.norm(away, axis=1, keepdims=True)
            straight = np.array([x, 0, 0]) + away[:, None] * np.linspace(0.5, 1.05, 5)[None, :, None]
            put(shapes.strands(straight + np.cumsum(rng.normal(0, 0.02, (4000, 5, 3)), 1),
                               np.array([0.008, 0.007, 0.006, 0.004, 0.002])),
                paint(f"hair {x}", tuple(rng.uniform(0.1, 0.6, 3)), 0.4), (0, 0, 0))
            put(shapes.sphere(), paint("skin", (0.6, 0.4, 0.3)), (x, 0, 0), 0.52)
        lamp((-4, -5, 4), 800, 1.0)
        world("studio", 0.5)

    def drapery(self, rng: Random) -> None:
        """Folded cloths with photographs on them, one behind another."""
        for index in range(4):
            put(shapes.cloth(rng), self._photograph(18 + index, 0.9), (-2.4 + 1.6 * index, 0.3 * index - 0.4, 0.1),
                (1.0, 0.8, 1.7))
        put(shapes.box(), paint("floor", (0.3, 0.25, 0.2), 0.7), (0, 0.4, -1.9), (4, 2, 0.05))
        sun(2, 0.05, (0.5, -0.4, 0.3))
        world("courtyard", 0.6)

    def clutter(self, rng: Random) -> None:
        """Two hundred and sixty small things around the display plane."""
        makers = (shapes.gear, shapes.blob, shapes.spring, shapes.superquadric, shapes.lathe, shapes.torus_knot)
        kinds = [put(shapes.unit_sized(make(rng)), paint(f"kind {index}", tuple(rng.uniform(0.05, 0.9, 3)),
                                                         rng.uniform(0.1, 0.8)), (0, 9, 0), 0.2)
                 for index, make in enumerate(makers)]
        for _ in range(260):
            again(kinds[rng.integers(6)], tuple(rng.uniform(-1, 1, 3) * (3.2, 1.5, 1.8) + (0, 0.5, 0)),
                  rng.uniform(0.08, 0.3), tuple(rng.uniform(0, 6.3, 3)))
        sun(2.0, 0.05, (0.5, 0.3, 0.2))
        world("forest", 0.7)

    def shelf(self, rng: Random) -> None:
        """Books with photographs on their backs."""
        for z in (-1.6, -0.3, 1.0):
            put(shapes.box(), self._photograph(22, 0.4), (0, 1.0, z), (3.6, 0.7, 0.04))
        for index in range(24):
            put(shapes.box(), self._photograph(index),
                (-3.3 + 0.29 * index, 0.8 + rng.uniform(-0.2, 0.2), (-1.6, -0.3, 1.0)[index % 3] + 0.45),
                (0.1, 0.4, 0.4))
        put(shapes.box(), paint("back", (0.4, 0.3, 0.2)), (0, 2.2, 0), (4, 0.05, 2.3))
        lamp((2, -5, 3), 700, 0.8)
        world("interior", 0.3)

    def metal(self, rng: Random) -> None:
        """Knots of metal on a glossy floor, which mirrors them and a photograph."""
        for index in range(5):
            put(shapes.unit_sized(shapes.torus_knot(rng)),
                paint(f"metal {index}", tuple(rng.uniform(0.5, 0.95, 3)), 0.05 + 0.08 * index, Metallic=1.0),
                (-2.6 + 1.3 * index, 0.4 * (index - 2), 0.2 * (index % 2)), 0.65)
        put(shapes.box(), paint("gloss", (0.05, 0.05, 0.06), 0.08), (0, 0.5, -1.5), (4, 2, 0.05))
        put(shapes.card(), self._photograph(7), (0, 2.6, 0.5), (4, 1, 2))
        lamp((0, -4, 4), 500, 1.0)
        world("sunset", 0.6)

    def deepglass(self, _rng: Random) -> None:
        """Vessels of clear glass, one behind another, before a photograph."""
        put(shapes.card(), self._photograph(9), (0, 6, 0), (7, 1, 4))
        put(shapes.box(), paint("table", (0.4, 0.3, 0.2), 0.4), (0, 2, -1.9), (5, 4, 0.05))
        profile = np.array([0.3, 0.5, 0.5, 0.3]), np.array([-1.0, -0.5, 0.5, 1.0]), 0.06
        for index in range(6):
            put(shapes.unit_sized(shapes.revolve(*profile)), glass(f"glass {index}"),
                (-2.6 + 1.05 * index, -1.5 + 1.1 * index, -0.6), 0.9)
        sun(3, 0.02, (0.6, 0.2, 0.2))
        world("city", 0.6)


NAMES = ("pane", "print", "hall", "street", "hair", "drapery", "clutter", "shelf", "metal", "deepglass")


def main(photographs: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(NAMES):
        demo_camera()
        getattr(Scenes(photographs), name)(np.random.default_rng([91, number]))
        bpy.ops.file.pack_all()
        save(folder / f"{name}.blend")


if __name__ == "__main__":
    main(**script_paths(__doc__, photographs="PHOTOGRAPHS", folder="DIR"))
