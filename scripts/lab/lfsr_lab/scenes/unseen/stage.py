"""What the unseen scenes share: materials, instances, light, and the camera of the demo scene.

One unit is 10 cm of the 32-inch display: the camera looks along +Y from 1 m, the
display plane is y = 0 and reaches from -3.5 to 3.5 in x, -2 to 2 in z.
"""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np

from blender_addon import compat
from lfsr_lab.scenes.shared.graph import Graph, principled
from lfsr_lab.scenes.shared.objects import add_object, add_surface
from lfsr_lab.scenes.shared.surfaces import Surface

CAMERA_DISTANCE, DISPLAY_WIDTH = 10.0, 7.084
HALF_WIDTH, HALF_HEIGHT = 3.5, 2.0


def begin() -> None:
    """An empty scene with the camera, rendered by Cycles."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "HORIZONTAL", 2 * math.atan(DISPLAY_WIDTH / 2 / CAMERA_DISTANCE)
    camera.dof.use_dof, camera.dof.focus_distance = True, CAMERA_DISTANCE
    scene.camera = add_object(camera, None, "camera")
    scene.camera.location, scene.camera.rotation_euler = (0, -CAMERA_DISTANCE, 0), (math.pi / 2, 0, 0)


def paint(name: str, color: tuple[float, float, float], roughness: float = 0.5, **inputs: float) -> bpy.types.Material:
    """A Principled material; ``color`` scene-linear, ``inputs`` by their names with _ for a space."""
    material, _, shader = principled(name)
    values = {"Base Color": (*color, 1.0), "Roughness": roughness}
    values |= {key.replace("_", " "): value for key, value in inputs.items()}
    for key, value in values.items():
        shader.inputs[key].default_value = value
    return material


def put(surface: Surface, material: bpy.types.Material, place: tuple[float, float, float],
        size: tuple[float, float, float] = (1, 1, 1), turn: tuple[float, float, float] = (0, 0, 0)) -> bpy.types.Object:
    """An object of a surface at a place."""
    thing = add_surface(surface, material)
    thing.location, thing.scale, thing.rotation_euler = place, size, turn
    return thing


def again(thing: bpy.types.Object, place: tuple[float, float, float], size: tuple[float, float, float],
          turn: tuple[float, float, float]) -> bpy.types.Object:
    """The same mesh once more."""
    other = bpy.data.objects.new(thing.name, thing.data)
    bpy.context.scene.collection.objects.link(other)
    other.location, other.scale, other.rotation_euler = place, size, turn
    return other


def lamp(place: tuple[float, float, float], watts: float, size: float,
         color: tuple[float, float, float] = (1, 1, 1)) -> None:
    """A square lamp that looks at the middle of the display."""
    data = bpy.data.lights.new("lamp", "AREA")
    data.energy, data.size, data.color = watts, size, color
    item = add_object(data, None, "lamp")
    item.location = place
    x, y, z = -np.asarray(place, float)
    item.rotation_euler = (math.atan2(math.hypot(x, y), -z), 0, math.atan2(-x, y))


def sun(strength: float, turn: tuple[float, float, float]) -> None:
    """A sun half a degree across."""
    data = bpy.data.lights.new("sun", "SUN")
    data.energy, data.angle = strength, math.radians(0.5)
    add_object(data, None, "sun").rotation_euler = turn


def world(picture: str, strength: float, seen: bool = False) -> None:
    """One of the HDRIs that ship inside Blender as light, and, if ``seen``, behind everything."""
    item = bpy.data.worlds.new("world")
    compat.use_nodes(item)
    scene = bpy.context.scene
    scene.world, scene.render.film_transparent = item, not seen
    graph = Graph(item.node_tree)
    folder = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world")
    image = bpy.data.images.load(str(folder / f"{picture}.exr"))
    image.pack()
    background = graph.only("BACKGROUND")
    graph.feed(background.inputs["Color"], graph.node("ShaderNodeTexEnvironment", image=image).outputs["Color"])
    background.inputs["Strength"].default_value = strength
