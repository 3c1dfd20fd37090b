"""Light: the HDRIs of Blender, sky colours, sun, lamps and small glowing balls, alone and mixed."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from blender_addon import compat
from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import Graph, add_object, add_surface, principled, settle
from lfsr_lab.scenes.training.materials import random_color
from lfsr_lab.scenes.training.stage import Stage

SETUPS = {"picture": 40, "picture+lamps": 16, "lamps": 16, "sun": 14, "sparks": 7, "sky": 7, "dark": 22}


def light_open_scene(stage: Stage) -> None:
    """Light for a scene without walls."""
    setup = stage.pick(SETUPS)
    stage.note("light", setup=setup)
    if setup == "dark":
        light_dark(stage, int(stage.rng.integers(1, 3)))
        return
    if setup.startswith("picture"):
        graph, color = _world(stage, 1.0)
        paths = sorted(Path(bpy.utils.system_resource("DATAFILES", path="studiolights/world")).glob("*.exr"))
        path = paths[stage.rng.integers(len(paths))]
        around, tilt = stage.rng.uniform(0, 2 * math.pi), stage.rng.normal(0, 0.2)
        vector = graph.node("ShaderNodeMapping", {"Vector": graph.node("ShaderNodeTexCoord").outputs["Generated"],
                                                  "Rotation": (tilt, 0.0, around)}).outputs["Vector"]
        image = bpy.data.images.load(str(path), check_existing=True)
        graph.feed(color, graph.node("ShaderNodeTexEnvironment", {"Vector": vector}, image=image).outputs["Color"])
        stage.note("world", file=path.name, turn=around)
    else:
        _world_color(stage, stage.log_uniform(0.02, 0.25) if setup != "sky" else 1.0)
    if setup == "sun":
        strength = stage.log_uniform(2, 8)
        light = bpy.data.lights.new("sun", "SUN")
        light.energy, light.angle, light.color = strength, stage.log_uniform(0.005, 0.2), _lamp_color(stage)
        _add_lamp(stage, light, (0, 0, 0)).rotation_euler = (stage.rng.uniform(-0.3, 1.2), stage.rng.uniform(-1.1,
                                                                                                             1.1), 0)
        stage.note("sun", angle=light.angle)
    if setup.endswith("lamps"):
        for _ in range(stage.rng.integers(1, 4)):
            lamp(stage, _above(stage), stage.log_uniform(0.5, 5))
    if setup == "sparks":
        for _ in range(stage.rng.integers(4, 30)):
            glowing_ball(stage)


def _world(stage: Stage, strength: float) -> tuple[Graph, bpy.types.NodeSocket]:
    """Return the graph of a new world, and the colour input of its background."""
    world = bpy.data.worlds.new("world")
    compat.use_nodes(world)
    bpy.context.scene.world = world
    world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 512
    graph = Graph(world.node_tree)
    background = graph.only("BACKGROUND")
    background.inputs["Strength"].default_value = strength
    stage.dimmers.append((background.inputs["Strength"], "default_value"))
    return graph, background.inputs["Color"]


def _world_color(stage: Stage, strength: float) -> None:
    graph, background = _world(stage, strength)
    color = random_color(stage, 0.5, 1)
    if stage.chance(0.5):
        ramp = graph.node("ShaderNodeValToRGB", {0: graph.node("ShaderNodeSeparateXYZ", {
            "Vector": graph.node("ShaderNodeTexCoord").outputs["Generated"]}).outputs["Z"]})
        ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = random_color(stage), color
        color = ramp.outputs["Color"]
    graph.feed(background, color)


def _above(stage: Stage) -> Array:
    """A place for a lamp: around the scene, more often above and before it."""
    angle, height = stage.rng.uniform(0, 2 * math.pi), stage.rng.uniform(-0.2, 1)
    reach = stage.rng.uniform(2, 4)
    return reach * np.array([math.cos(angle), math.sin(angle) - 0.3, height])


def _lamp_color(stage: Stage) -> tuple[float, float, float]:
    if stage.chance(0.2):
        return random_color(stage, 0.6, 1)[:3]
    warm = stage.rng.uniform(-0.3, 0.5)
    return (1.0, 1 - 0.35 * max(warm, 0) - 0.1 * max(-warm, 0), 1 - 0.8 * max(warm, 0))


def _add_lamp(stage: Stage, light: bpy.types.Light, at: Array | tuple[float, ...]) -> bpy.types.Object:
    thing = add_object(light, None, light.name)
    thing.location = at
    stage.dimmers.append((light, "energy"))
    return thing


def lamp(stage: Stage, at: Array, brightness: float, small: bool = False) -> None:
    """Area, point or spot lamp at a place, aimed at the middle; a white object shows about ``brightness``."""
    kind = stage.pick({"POINT": 3, "SPOT": 1} if small else {"AREA": 60, "POINT": 25, "SPOT": 15})
    light = bpy.data.lights.new("lamp", kind)
    light.color = _lamp_color(stage)
    # A Lambertian surface at distance d shows P / (4 π² d²) under a point lamp of P watts, four times that
    # straight under an area lamp.
    light.energy = brightness * 4 * math.pi ** 2 * float(at @ at) / (4 if kind == "AREA" else 1)
    if kind == "AREA":
        light.size = stage.log_uniform(0.1, 2.5)
    else:
        light.shadow_soft_size = stage.log_uniform(0.01, 0.06 if small else 0.3)
    _add_lamp(stage, light, at).rotation_euler = Vector(-at).to_track_quat("-Z", "Y").to_euler()
    stage.note("lamp", kind=kind, at=at, brightness=brightness)


def light_dark(stage: Stage, lamps: int, reach: float | None = None) -> None:
    """Next to no light from around, and small lamps: within ``reach`` of the middle, or around the scene."""
    _world_color(stage, stage.log_uniform(0.0005, 0.02))
    stage.bright_lens = 0.9
    for _ in range(lamps):
        at = stage.rng.uniform(-1, 1, 3) * reach if reach else _above(stage) * stage.rng.uniform(0.4, 1)
        lamp(stage, at, stage.log_uniform(0.5, 5), small=True)


def glowing_ball(stage: Stage, size: float | None = None) -> None:
    """Add a small, very bright ball somewhere in view."""
    material, _, shader = principled("spark", Emission_Color=(*_lamp_color(stage), 1.0),
                                     Emission_Strength=stage.log_uniform(20, 200))
    stage.dimmers.append((shader.inputs["Emission Strength"], "default_value"))
    settle(add_surface(surfaces.sphere(16, 9), material, "spark"), stage.place(), size or stage.log_uniform(0.02, 0.09),
           np.zeros(3))


def light_room(stage: Stage, middle: Array, half: Array) -> None:
    """Lamp panels under the ceiling, sometimes a lamp in the room as well."""
    _world_color(stage, 0.02)
    for _ in range(stage.rng.integers(1, 4)):
        light = bpy.data.lights.new("panel", "AREA")
        light.shape, light.size = "RECTANGLE", stage.rng.uniform(0.15, 0.6) * half[0]
        light.size_y, light.color = stage.rng.uniform(0.15, 0.6) * half[1], _lamp_color(stage)
        light.energy = 100 * stage.log_uniform(0.5, 2)
        _add_lamp(stage, light, middle + half * [*stage.rng.uniform(-0.6, 0.6, 2), 0.98])
    if stage.chance(0.3):
        glowing_ball(stage)
    stage.note("light", setup="room")
