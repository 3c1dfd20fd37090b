"""Random materials: kinds with colours from numbers, patterns or photographs; leaves and torn paper by alpha."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from blender_addon import compat
from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import Graph, add_object, add_surface, principled, settle
from lfsr_lab.scenes.training.stage import Stage

KINDS = {"plastic": 15, "photo": 24, "noise": 12, "metal": 12, "glass": 11, "skin": 6, "cloth": 6,
         "lacquer": 6, "worn": 7, "glow": 1.5, "film": 2.5}
ABSORBING = 0.35  # fraction of the glass
LEAF_PIXELS = 64
Inputs = dict[str, Any]  # values or sockets by the name of the input


def random_material(stage: Stage, closed: bool = True, uv: bool = True, kind: str | None = None) -> bpy.types.Material:
    """Material of a random or given kind; glass only on closed solids."""
    weights = {name: weight for name, weight in KINDS.items() if closed or name != "glass"}
    kind = kind or stage.pick(weights)
    material, graph, shader = principled(kind)
    graph.set(shader, BUILDERS[kind](stage, graph, uv))
    if kind == "glow":
        stage.dimmers.append((shader.inputs["Emission Strength"], "default_value"))
    if (kind not in ("glow", "photo") or stage.chance(0.3)) and stage.chance(0.4):
        height = pattern_value(stage, graph, uv)
        bump = graph.node("ShaderNodeBump", {"Height": height, "Strength": stage.log_uniform(0.05, 0.8),
                                             "Distance": stage.log_uniform(0.003, 0.05)})
        graph.feed(shader.inputs["Normal"], bump.outputs["Normal"])
    stage.note("material", kind=kind)
    return material


def random_color(stage: Stage, low: float = 0.04, high: float = 0.9) -> tuple[float, float, float, float]:
    """Opaque scene-linear colour of random hue; greys are as likely as strong colours."""
    rng = stage.rng
    return (*colorsys.hsv_to_rgb(rng.random(), rng.beta(1, 1.3), stage.log_uniform(low, high)), 1.0)


def coordinates(stage: Stage, graph: Graph, uv: bool, low: float = 0.5, high: float = 4.0) -> bpy.types.NodeSocket:
    """Texture coordinates with random scale, turn and offset."""
    source = graph.node("ShaderNodeTexCoord").outputs["UV" if uv and stage.chance(0.5) else "Generated"]
    scale, rng = stage.log_uniform(low, high), stage.rng
    return graph.node("ShaderNodeMapping", {
        "Vector": source, "Scale": (scale,) * 3, "Rotation": tuple(rng.uniform(-math.pi, math.pi, 3)),
        "Location": tuple(rng.uniform(0, 10, 3))}).outputs["Vector"]


def photo(stage: Stage, graph: Graph, vector: bpy.types.NodeSocket, box: bool = True) -> bpy.types.Node:
    """Image texture with one of the photographs, projected flat or from the six sides."""
    path = stage.textures[stage.rng.integers(len(stage.textures))]
    image = bpy.data.images.load(str(path), check_existing=True)
    stage.note("texture", file=path.name)
    return graph.node("ShaderNodeTexImage", {"Vector": vector}, image=image, extension="MIRROR",
                      projection="BOX" if box else "FLAT", projection_blend=0.2 if box else 0.0)


def color_source(stage: Stage, graph: Graph, uv: bool) -> Any:
    """A colour value or the output of a photograph or pattern."""
    kind = stage.pick({"flat": 35, "photo": 30, "pattern": 35})
    if kind == "flat":
        return random_color(stage)
    if kind == "photo" and stage.textures:
        return photo(stage, graph, coordinates(stage, graph, uv)).outputs["Color"]
    return pattern_color(stage, graph, uv)


def pattern_value(stage: Stage, graph: Graph, uv: bool) -> bpy.types.NodeSocket:
    """Grey output of a procedural pattern at a scale from coarse to finer than a lens."""
    vector, rng = coordinates(stage, graph, uv, 1, 1.5), stage.rng
    scale, kind = stage.log_uniform(1.5, 60), stage.pick({"noise": 4, "voronoi": 3, "wave": 2, "check": 1, "brick": 1})
    if kind == "noise":
        return graph.node("ShaderNodeTexNoise", {"Vector": vector, "Scale": scale, "Detail": rng.uniform(0, 8),
                                                 "Distortion": rng.choice([0, 0, 1.5])}).outputs[0]
    if kind == "voronoi":
        feature = str(rng.choice(["F1", "F2", "DISTANCE_TO_EDGE"]))
        cells = graph.node("ShaderNodeTexVoronoi", {"Vector": vector, "Scale": scale}, feature=feature)
        return cells.outputs["Distance"]
    if kind == "wave":
        return graph.node("ShaderNodeTexWave", {"Vector": vector, "Scale": scale / 3, "Distortion": rng.uniform(0, 8)},
                          wave_type=str(rng.choice(["BANDS", "RINGS"]))).outputs[0]
    if kind == "check":
        return graph.node("ShaderNodeTexChecker", {"Vector": vector, "Scale": scale}).outputs[1]
    return graph.node("ShaderNodeTexBrick", {"Vector": vector, "Scale": scale / 2}).outputs[1]


def pattern_color(stage: Stage, graph: Graph, uv: bool) -> bpy.types.NodeSocket:
    """Procedural pattern between two to four random colours."""
    ramp = graph.node("ShaderNodeValToRGB", {0: pattern_value(stage, graph, uv)})
    elements = ramp.color_ramp.elements
    for _ in range(stage.rng.integers(0, 3)):
        elements.new(stage.rng.uniform(0.2, 0.8))
    for element in elements:
        element.color = random_color(stage)
    ramp.color_ramp.interpolation = "CONSTANT" if stage.chance(0.25) else "LINEAR"
    return ramp.outputs["Color"]


def _roughness(stage: Stage, graph: Graph, uv: bool, low: float, high: float) -> Any:
    value = float(stage.rng.uniform(low, high))
    if not stage.chance(0.3):
        return value
    span = {"Value": pattern_value(stage, graph, uv), "To Min": low, "To Max": high}
    return graph.node("ShaderNodeMapRange", span).outputs["Result"]


def _glass(stage: Stage, graph: Graph, uv: bool) -> Inputs:
    absorbing = stage.chance(ABSORBING)
    tint = (1.0, 1.0, 1.0, 1.0) if absorbing or stage.chance(0.6) else random_color(stage, 0.5, 1)
    values = {"Base Color": tint, "Transmission Weight": 1.0, "IOR": float(stage.rng.uniform(1.2, 1.8)),
              "Roughness": float(stage.rng.choice([0, 0, 0, 0.05, 0.25]))}
    if absorbing:
        volume = graph.node("ShaderNodeVolumeAbsorption", {"Color": random_color(stage, 0.4, 0.9),
                                                           "Density": stage.log_uniform(1, 20)})
        graph.feed(graph.only("OUTPUT_MATERIAL").inputs["Volume"], volume.outputs[0])
    return values


def _worn(stage: Stage, graph: Graph, uv: bool) -> Inputs:
    """Two surfaces by one mask: paint over metal, dirt over leather."""
    edge = graph.node("ShaderNodeMapRange", {"Value": pattern_value(stage, graph, uv), "From Min": 0.4,
                                             "From Max": 0.6}).outputs["Result"]
    mix = graph.node("ShaderNodeMix", {0: edge}, data_type="RGBA")
    for socket in mix.inputs:
        if socket.type == "RGBA":
            graph.feed(socket, color_source(stage, graph, uv))
    output = next(socket for socket in mix.outputs if socket.type == "RGBA")
    shine = graph.node("ShaderNodeMapRange", {"Value": edge, "To Min": float(stage.rng.uniform(0, 1)),
                                              "To Max": float(stage.rng.uniform(0, 1))}).outputs["Result"]
    return {"Base Color": output, "Metallic": edge if stage.chance(0.6) else 0.0, "Roughness": shine}


def _glow(stage: Stage, graph: Graph, uv: bool) -> Inputs:
    color = color_source(stage, graph, uv)
    return {"Base Color": color, "Emission Color": color, "Emission Strength": stage.log_uniform(0.5, 15)}


# Inputs of the Principled shader by kind. The order of the entries is the order of the random numbers.
BUILDERS: dict[str, Callable[[Stage, Graph, bool], Inputs]] = {
    "plastic": lambda stage, graph, uv: {
        "Base Color": random_color(stage), "Roughness": _roughness(stage, graph, uv, 0.05, 0.9),
        "Specular IOR Level": float(stage.rng.uniform(0.1, 1))},
    "photo": lambda stage, graph, uv: {
        "Base Color": photo(stage, graph, coordinates(stage, graph, uv, 0.4, 6)).outputs["Color"] if stage.textures else
        color_source(stage, graph, uv), "Roughness": _roughness(stage, graph, uv, 0.1, 1)},
    "noise": lambda stage, graph, uv: {
        "Base Color": pattern_color(stage, graph, uv), "Roughness": _roughness(stage, graph, uv, 0.1, 1)},
    "metal": lambda stage, graph, uv: {
        "Base Color": random_color(stage, 0.3, 0.95) if stage.chance(0.7) else color_source(stage, graph, uv),
        "Metallic": 1.0, "Roughness": _roughness(stage, graph, uv, 0.0, 0.6),
        "Anisotropic": float(stage.rng.choice([0, 0, 0.7]))},
    "glass": _glass,
    "skin": lambda stage, graph, uv: {
        "Base Color": color_source(stage, graph, uv), "Subsurface Weight": 1.0,
        "Subsurface Radius": tuple(stage.rng.uniform(0.1, 1, 3)), "Subsurface Scale": stage.log_uniform(0.01, 0.2),
        "Roughness": float(stage.rng.uniform(0.3, 0.7))},
    "cloth": lambda stage, graph, uv: {
        "Base Color": color_source(stage, graph, uv), "Roughness": 0.9, "Sheen Weight": 1.0,
        "Sheen Roughness": float(stage.rng.uniform(0.2, 0.6))},
    "lacquer": lambda stage, graph, uv: {
        "Base Color": color_source(stage, graph, uv), "Roughness": float(stage.rng.uniform(0.3, 0.9)),
        "Metallic": float(stage.chance(0.3)), "Coat Weight": 1.0, "Coat Roughness": float(stage.rng.uniform(0, 0.15))},
    "worn": _worn,
    "glow": _glow,
    "film": lambda stage, graph, uv: {
        "Base Color": random_color(stage), "Metallic": float(stage.chance(0.7)),
        "Roughness": float(stage.rng.uniform(0, 0.4)), "Thin Film Thickness": float(stage.rng.uniform(200, 900))}}


def leaf_material(stage: Stage) -> bpy.types.Material:
    """Translucent leaf drawn on the whole texture square, its outline in the alpha channel."""
    material, graph, shader = principled("leaf")
    uv = graph.node("ShaderNodeTexCoord").outputs["UV"]
    texture = graph.node("ShaderNodeTexImage", {"Vector": uv}, image=_leaf_image(stage))
    color, alpha = texture.outputs["Color"], texture.outputs["Alpha"]
    graph.set(shader, {"Base Color": color, "Alpha": alpha, "Roughness": float(stage.rng.uniform(0.3, 0.9))})
    # Light passes through the sheet where it is not cut away.
    amount = graph.node("ShaderNodeMath", {0: alpha, 1: float(stage.rng.uniform(0, 0.5))}, operation="MULTIPLY")
    through = graph.node("ShaderNodeBsdfTranslucent", {"Color": color})
    mix = graph.node("ShaderNodeMixShader", {0: amount.outputs[0], 1: shader.outputs[0], 2: through.outputs[0]})
    graph.feed(graph.only("OUTPUT_MATERIAL").inputs["Surface"], mix.outputs[0])
    stage.note("material", kind="leaf")
    return material


def _leaf_image(stage: Stage) -> bpy.types.Image:
    """Outline with lobes, veins and blotches, RGBA."""
    rng = stage.rng
    x, y = np.meshgrid(*[np.linspace(-1, 1, LEAF_PIXELS)] * 2)
    angle, reach = np.arctan2(x, -y), np.hypot(x / rng.uniform(0.45, 0.95), y)
    lobes = 0.8 + rng.uniform(0, 0.35) * np.cos(rng.integers(3, 9) * angle)
    veins = np.abs(np.sin(rng.uniform(5, 12) * (y + rng.uniform(0.3, 1) * np.abs(x)))) < 0.15
    first, second = (np.array(random_color(stage, 0.1, 0.7)[:3]) for _ in range(2))
    blend = np.clip(0.5 + 0.5 * np.sin(7 * x + rng.uniform(0, 6)) * np.cos(6 * y), 0, 1)[..., None]
    color = np.where((veins | (np.abs(x) < 0.04))[..., None], 0.6 * second, first * blend + second * (1 - blend))
    pixels = np.concatenate([color, (reach < lobes)[..., None]], -1).astype(np.float32)
    image = bpy.data.images.new("leaf", LEAF_PIXELS, LEAF_PIXELS, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def paper_material(stage: Stage, cut: bool) -> bpy.types.Material:
    """A photograph (or plain paper) on a sheet; ``cut`` tears holes into it."""
    material, graph, shader = principled("paper")
    uv, rng = graph.node("ShaderNodeTexCoord").outputs["UV"], stage.rng
    zoom = stage.log_uniform(0.2, 2)
    spot = graph.node("ShaderNodeMapping", {"Vector": uv, "Scale": (zoom,) * 3,
                                            "Location": tuple(rng.uniform(0, 1, 3))}).outputs["Vector"]
    color = photo(stage, graph, spot, box=False).outputs["Color"] if stage.textures else random_color(stage)
    graph.set(shader, {"Base Color": color, "Roughness": float(rng.uniform(0.2, 1))})
    if cut:
        noise = graph.node("ShaderNodeTexNoise", {"Vector": spot, "Scale": stage.log_uniform(2, 20) / zoom})
        hole = graph.node("ShaderNodeMath", {0: noise.outputs[0], 1: float(rng.uniform(0.4, 0.55))},
                          operation="GREATER_THAN")
        graph.feed(shader.inputs["Alpha"], hole.outputs[0])
    stage.note("material", kind="paper", cut=cut)
    return material


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
