"""Scenes of other people's models that no method was prepared for, around the display of ``demo_camera``.

    python scripts/lab/lfsr_lab/scenes/real_scenes.py MODELS PHOTOGRAPHS DIR

MODELS: the folder 2.0 of github.com/KhronosGroup/glTF-Sample-Models; PHOTOGRAPHS: the Kodak images, 01.png to 24.png.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
import numpy as np
from mathutils import Matrix, Vector

from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import (
    again,
    demo_camera,
    joined,
    lamp,
    paint,
    principled,
    put,
    save,
    script_paths,
    settle,
    sun,
    world,
)

FILES = {name: f"{name}/glTF/{name}.gltf" for name in (
    "CesiumMan", "CesiumMilkTruck", "Duck", "Monster", "DamagedHelmet", "BoomBox", "Lantern", "VC")}
FILES |= {name: f"{name}/glTF-Binary/{name}.glb" for name in (
    "RiggedFigure", "BrainStem", "2CylinderEngine", "ReciprocatingSaw")}
SKY = ("skbox", "Rectangle01")  # what surrounds the model VC
Random = np.random.Generator
Place = tuple[float, float, float]
Color = tuple[float, float, float]


class Scenes:
    def __init__(self, models: Path, photographs: Path) -> None:
        self.models, self.photographs = models, photographs

    def figures(self, rng: Random) -> None:
        """Many small figures on steps that rise from before the display plane to behind it."""
        stone = tiles("stone", (0.4, 0.35, 0.28), (0.28, 0.25, 0.2), 14, 0.7)
        kinds = [self._model(name, (30, 0, 0), 1) for name in ("CesiumMan", "RiggedFigure", "Monster", "Duck",
                                                               "BrainStem")]
        for step in range(7):
            y, z = -1.2 + 0.75 * step, -1.9 + 0.52 * step
            put(surfaces.box(), stone, (0, y + 0.3, z - 0.5), (4.4 + 0.2 * step, 0.38, 0.5))
            for column in range(13):
                x = (-3.6 + 0.6 * column + rng.uniform(-0.12, 0.12)) * (1 + y / 12)
                stand(again(kinds[int(rng.choice(5, p=(.3, .2, .15, .1, .25)))], (0, 0, 0)),
                      (x, y + rng.uniform(-0.05, 0.25), z), rng.uniform(0.2, 0.27), rng.uniform(0, 6.3))
        for kind in kinds:
            bpy.data.objects.remove(kind)
        sun(1.2, 0.03, (0.8, -0.2, 0.5))
        world("city", 0.3)

    def interior(self, rng: Random) -> None:
        """A room that fills every view: a window, a bulb, shelves with models, photographs on the wall."""
        wood = paint("wood", (0.3, 0.17, 0.08), 0.4)
        walls(wood)
        for index, x in enumerate((-3.6, -1.2, 1.2, 3.6)):
            put(surfaces.box(), wood, (x, 4.9, 1.4), (1.02, 0.03, 0.72))
            put(surfaces.card(), self._photograph(3 + 4 * index, 0.3), (x, 4.85, 1.4), (0.95, 1, 0.65))
        for level in (-1.3, -0.3):
            put(surfaces.box(), wood, (0, 4.3, level), (4.0, 0.5, 0.05))
            for column, name in enumerate(("Duck", "BoomBox", "2CylinderEngine", "DamagedHelmet", "ReciprocatingSaw",
                                           "Monster")):
                at = (-3.4 + 1.35 * column + 0.2 * level, 4.3, level + 0.06)
                self._model(name, at, 0.42, rng.uniform(-0.8, 0.8))
        put(surfaces.box(), wood, (0.6, 0.6, -1.05), (2.0, 1.1, 0.06))
        for x, y in ((-1.2, -0.3), (2.4, -0.3), (-1.2, 1.5), (2.4, 1.5)):
            put(surfaces.box(), wood, (x, y, -1.65), (0.07, 0.07, 0.55))
        for name, at, size, turn in (
                ("DamagedHelmet", (0.0, 0.3, -0.98), 0.6, 0.3), ("BoomBox", (1.7, 0.6, -0.98), 0.6, -0.4),
                ("CesiumMilkTruck", (-0.9, -0.1, -0.98), 0.4, 0.6), ("Lantern", (-3.2, 1.6, -2.2), 1.2, 0.4),
                ("CesiumMan", (3.9, 2.2, -2.2), 1.35, -0.5), ("Duck", (2.3, -1.6, -2.2), 0.5, -2.2)):
            self._model(name, at, size, turn)
        glass = paint("glass", (0.98, 0.99, 1.0), 0.0, Transmission_Weight=1.0, IOR=1.45)
        put(surfaces.unit_sized(surfaces.lathe(rng)), glass, (0.9, 0.0, -0.6), 0.4)
        lamp((-7.5, -1.2, 2.6), 1500, 3.0, (1.0, 0.95, 0.88)).rotation_euler = (0, -math.radians(68), 0)
        put(surfaces.sphere(), principled("bulb", Emission_Color=(1, 0.75, 0.45, 1), Emission_Strength=14.0)[0],
            (2.6, 2.6, 1.9), 0.22)
        world("courtyard", 0.6)

    def study(self, rng: Random) -> None:
        """The same room with the display plane in its middle."""
        self.interior(rng)
        for item in set(bpy.context.scene.objects) - {bpy.context.scene.camera}:
            item.location.y -= 2.2

    def frosted(self, rng: Random) -> None:
        """Models and a photograph behind panes of frosted glass, and bowls of it."""
        put(surfaces.card(), self._photograph(23, 0.6), (0, 1.6, 0), (4.0, 1, 2.4))
        self._model("DamagedHelmet", (-1.9, 0.7, -1.6), 1.2, 0.4)
        self._model("CesiumMilkTruck", (1.4, 0.8, -1.7), 1.3, 0.6)
        for index, roughness in enumerate((0.1, 0.2, 0.35)):
            glass = paint(f"frosted {index}", (0.96, 0.98, 0.97), roughness, Transmission_Weight=1.0, IOR=1.45)
            put(surfaces.box(), glass, (-2.3 + 2.2 * index, -0.55, 0.25), (0.7, 0.04, 1.5), (0, 0, 0.15 * (index - 1)))
            put(surfaces.unit_sized(surfaces.lathe(rng)), glass, (-1.2 + 2.2 * index, -0.9, -1.1), 0.65)
        put(surfaces.box(), paint("table", (0.2, 0.12, 0.07), 0.3), (0, 0.2, -1.85), (3.8, 1.6, 0.1))
        lamp((4, -5, 5), 600, 1.0, (1.0, 0.92, 0.8))
        world("studio", 0.5)

    def lanterns(self, rng: Random) -> None:
        """Lanterns in the dark before photographs, on a glossy floor."""
        put(surfaces.box(), tiles("floor", (0.3, 0.3, 0.32), (0.12, 0.12, 0.13), 30, 0.15), (0, 1.0, -1.95),
            (4.5, 3.5, 0.1))
        for index in range(4):
            put(surfaces.card(), self._photograph(2 + 5 * index, 0.7), (-3.3 + 2.2 * index, 2.4, 0.0), (1.05, 1, 1.4))
        first = self._model("Lantern", (-2.4, -0.3, -1.85), 1.5, 0.5)
        for x, y, size in ((0.3, 0.5, 1.2), (2.3, -0.6, 1.4), (1.4, 1.5, 1.0), (-1.0, 1.7, 1.1)):
            stand(again(first, (0, 0, 0)), (x, y, -1.85), size, rng.uniform(0, 6.3))
        self._model("CesiumMan", (-0.9, 0.1, -1.85), 0.75, 0.4)
        self._model("Monster", (1.2, -0.7, -1.85), 0.35, -0.6)
        shader(first.data.materials[0]).inputs["Emission Strength"].default_value = 12.0
        for x, y, z in ((-2.0, -0.6, 0.5), (0.6, 0.3, 0.0), (2.0, -0.8, 0.3)):
            bulb = lamp((x, y, z), 8, 0.05, (1.0, 0.6, 0.25)).data
            bulb.type, bulb.shadow_soft_size = "POINT", 0.03
        world("night", 0.08)

    def brainstem(self, _rng: Random) -> None:
        """A figure of plastic and metal in the middle of its dance."""
        self._whole("BrainStem", (0, 0.4), (6.0, 3.8), (0, 0.2, 0), frame=30)
        world("studio", 0.8)

    def damaged(self, _rng: Random) -> None:
        """A worn helmet as high as the display."""
        self._whole("DamagedHelmet", (0, 0.5), (6.0, 3.7), (0, 0.3, 0))
        world("forest", 0.8)

    def vc(self, _rng: Random) -> None:
        """A city with bridges, thin as wires, under a hard sun."""
        self._whole("VC", (0.45, 0.5), (8.0, 4.2), (0, 1.0, 0))
        sun(2.0, 0.01, (0.7, 0.2, 0.5))
        world("city", 0.8)

    def turning(self, _rng: Random) -> None:
        """A helmet that turns by 3 degrees a frame, for six frames, beside a figure that stands."""
        helmet = self._model("DamagedHelmet", (0.2, 0.0, -1.7), 1.75, 0.3)
        self._model("CesiumMan", (-2.5, 0.6, -1.7), 1.3, 0.2)
        put(surfaces.box(), tiles("floor", (0.4, 0.36, 0.3), (0.2, 0.17, 0.14), 18, 0.3), (0, 0.8, -1.8),
            (3.6, 1.8, 0.1))
        bpy.context.scene.frame_end = 6
        for frame in range(1, 7):
            helmet.rotation_euler[2] = 0.3 + math.radians(3) * (frame - 1)
            helmet.keyframe_insert("rotation_euler", frame=frame)
        lamp((-4, -5, 5), 500, 1.5, (1.0, 0.93, 0.85))
        world("city", 0.5)

    def _model(self, name: str, at: Place, size: float, turn: float = 0.0) -> bpy.types.Object:
        """Add a model as one mesh that stands on ``at``, its longest side twice ``size``."""
        model = joined(self._imported(name))
        low, high = corners([model], outside=0)
        longest = 2 / float((high - low).max())
        model.data.transform(Matrix.Scale(longest, 4) @ Matrix.Translation(Vector(-(low + high) / 2)))
        stand(model, at, size, turn)
        return model

    def _whole(self, name: str, turn: tuple[float, float], size: tuple[float, float], at: Place,
               frame: int = 1) -> None:
        """Add a model with its skeleton, turned, scaled into ``size`` (x, z) and centred at ``at``."""
        scene, root = bpy.context.scene, bpy.data.objects.new("root", None)
        scene.collection.objects.link(root)
        added = self._imported(name)
        for item in added:
            if item.type in ("CAMERA", "LIGHT") or item.name.startswith(SKY):
                bpy.data.objects.remove(item)
            elif item.parent is None:
                item.parent = root
        scene.frame_set(frame)
        root.rotation_euler = (turn[0], 0, turn[1])
        low, high = corners(scene.objects)
        root.scale = (min(size[0] / (high[0] - low[0]), size[1] / (high[2] - low[2])),) * 3
        low, high = corners(scene.objects)
        root.location = Vector(at) - Vector((low + high) / 2)

    def _imported(self, name: str) -> list[bpy.types.Object]:
        before = set(bpy.data.objects)
        bpy.ops.import_scene.gltf(filepath=str(self.models / FILES[name]), disable_bone_shape=True)
        bpy.context.view_layer.update()
        added = [item for item in bpy.data.objects if item not in before]
        plain: dict[str, dict[str, Any]] = {
            "Lantern": {"Base Color": (0.35, 0.22, 0.1, 1)}, "BoomBox": {"Roughness": 0.35, "Metallic": 0.2}}
        for material in {slot.material for item in added for slot in item.material_slots} if name in plain else ():
            for socket, value in plain[name].items():  # copies of the models exist that lack these textures
                for link in shader(material).inputs[socket].links:
                    material.node_tree.links.remove(link)
                shader(material).inputs[socket].default_value = value
        return added

    def _photograph(self, number: int, roughness: float) -> bpy.types.Material:
        material, graph, node = principled(f"photograph {number}", Roughness=roughness)
        image = bpy.data.images.load(str((self.photographs / f"{number:02d}.png").resolve()))
        graph.feed(node.inputs["Base Color"], graph.node("ShaderNodeTexImage", image=image).outputs["Color"])
        return material


def walls(wood: bpy.types.Material) -> None:
    """Put up a room that is open towards the cameras; its left wall has a window, with a lamp behind it."""
    wall = paint("wall", (0.75, 0.72, 0.66), 0.8)
    put(surfaces.box(), tiles("floor", (0.55, 0.5, 0.42), (0.18, 0.12, 0.09), 13, 0.2), (0, 1.2, -2.3), (6, 3.8, 0.1))
    for at, half in (((0, 1.2, 3.2), (6, 3.8, 0.1)), ((0, 5.0, 0.4), (6, 0.1, 3)), ((5.2, 1.2, 0.4), (0.1, 3.8, 3)),
                     ((-5.2, 3.6, 0.4), (0.1, 1.5, 3)), ((-5.2, -0.25, -1.7), (0.1, 2.35, 0.8)),
                     ((-5.2, -0.25, 2.9), (0.1, 2.35, 0.5))):
        put(surfaces.box(), wall, at, half)
    for y in (-2.6, -0.25, 2.1):
        put(surfaces.box(), wood, (-5.2, y, 0.8), (0.06, 0.06, 2.0))


def stand(thing: bpy.types.Object, at: Place, size: float, turn: float) -> None:
    """Place a mesh with its lowest point on ``at``."""
    low = min(vertex.co.z for vertex in thing.data.vertices)
    thing.rotation_mode = "XYZ"
    settle(thing, (at[0], at[1], at[2] - low * size), size, (0, 0, turn))


def corners(things: Sequence[bpy.types.Object], outside: float = 0.5) -> tuple[Array, Array]:
    """Smallest and largest coordinates (3,) of meshes as they are rendered; ``outside``: percent left out at each."""
    bpy.context.view_layer.update()
    graph, points = bpy.context.evaluated_depsgraph_get(), []
    for item in (item.evaluated_get(graph) for item in things if item.type == "MESH" and item.data.vertices):
        mesh = item.to_mesh()
        coordinates = np.empty(len(mesh.vertices) * 3, np.float32)
        mesh.vertices.foreach_get("co", coordinates)
        matrix = np.array(item.matrix_world)
        points.append(coordinates.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
    every = np.concatenate(points)
    return np.percentile(every, outside, 0), np.percentile(every, 100 - outside, 0)


def shader(material: bpy.types.Material) -> bpy.types.Node:
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def tiles(name: str, one: Color, two: Color, count: float, roughness: float) -> bpy.types.Material:
    """Return a floor of checks of two colours."""
    material, graph, node = principled(name, Roughness=roughness)
    checks = graph.node("ShaderNodeTexChecker", {"Color1": (*one, 1), "Color2": (*two, 1), "Scale": count,
                                                 "Vector": graph.node("ShaderNodeTexCoord").outputs["Generated"]})
    graph.feed(node.inputs["Base Color"], checks.outputs["Color"])
    return material


NAMES = ("figures", "interior", "frosted", "lanterns", "brainstem", "damaged", "vc", "turning", "study")


def main(models: Path, photographs: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(NAMES):
        demo_camera()
        getattr(Scenes(models, photographs), name)(np.random.default_rng([28, number]))
        bpy.ops.file.pack_all()
        save(folder / f"{name}.blend")


if __name__ == "__main__":
    main(**script_paths(__doc__, models="MODELS", photographs="PHOTOGRAPHS", folder="DIR"))
