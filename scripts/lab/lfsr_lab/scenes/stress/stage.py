"""What every stress scene stands on: an empty Blender, the camera array, light, and plain ways to add things.

World axes: X right, Z up, Y away from the viewer. One unit is one lens pitch, the
display plane is y = 0, see lfsr_lab.experiments.sweeps.sweeps.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import bpy
import numpy as np

from blender_addon.array import edit
from blender_addon.scene import subject
from blender_addon.scene.light import add_light
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray
from lfsr_lab.scenes.shared.graph import Graph, principled
from lfsr_lab.scenes.shared.objects import add_surface
from lfsr_lab.scenes.shared.surfaces import Surface
from lfsr_lab.scenes.stress.space import Space

SUN_TURN = (0.7, 0.0, -0.6)   # from the upper left, before the display
WORLD_STRENGTH, SUN_STRENGTH, SUN_ANGLE = 0.45, 1.2, 0.1


@dataclasses.dataclass(frozen=True)
class Stage:
    """One scene being built. ``frames``: of an animation. ``rng`` starts equally for every scene."""

    space: Space
    frames: int
    rng: np.random.Generator

    @classmethod
    def empty(cls, profile: DisplayProfile, scale: int, frames: int) -> Stage:
        """An empty scene with the camera array of ``profile`` and nothing else."""
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        scene = bpy.context.scene
        scene.render.engine, scene.render.film_transparent = "CYCLES", True
        scene.view_settings.view_transform = "Standard"
        array = CameraArray.for_display(profile, float(profile.lenses[0]))
        matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, -array.distance), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        edit.put(edit.add(scene, profile), (array, matrix))
        return cls(Space.of(profile, scale), frames, np.random.default_rng(7))


def world_light(picture: str = "city.exr", strength: float = WORLD_STRENGTH) -> bpy.types.Node:
    """Light from one of Blender's own world pictures, kept inside the file; its background node."""
    world = add_light(bpy.context.scene, picture)
    graph = Graph(world.node_tree)
    graph.only("TEX_ENVIRONMENT").image.pack()
    background = graph.only("BACKGROUND")
    background.inputs["Strength"].default_value = strength
    return background


def sun(strength: float = SUN_STRENGTH, angle: float = SUN_ANGLE) -> bpy.types.Object:
    """Light from the upper left of the viewer; ``angle`` in radians."""
    light = bpy.data.lights.new("sun", "SUN")
    light.energy, light.angle = strength, angle
    thing = bpy.data.objects.new("sun", light)
    thing.rotation_euler = SUN_TURN
    bpy.context.scene.collection.objects.link(thing)
    return thing


def surface_of(name: str, **inputs: Any) -> tuple[bpy.types.Material, Graph, bpy.types.Node]:
    """Principled material with ``inputs`` by socket name (spaces as _): material, its graph, its shader."""
    material, graph, shader = principled(name)
    for key, value in inputs.items():
        graph.feed(shader.inputs[key.replace("_", " ")], value)
    return material, graph, shader


def plain(name: str, color: tuple[float, float, float], **inputs: Any) -> bpy.types.Material:
    """Principled material of one scene-linear colour."""
    return surface_of(name, Base_Color=(*color, 1.0), **inputs)[0]


def glow(name: str, color: Any, strength: float) -> bpy.types.Material:
    """Material that shines and reflects nothing; ``color`` a colour or a function of the graph that gives one."""
    material, graph, shader = surface_of(name, Base_Color=(0.0, 0.0, 0.0, 1.0), Roughness=1.0, Specular_IOR_Level=0.0,
                                         Emission_Strength=strength)
    graph.feed(shader.inputs["Emission Color"], color(graph) if callable(color) else (*color, 1.0))
    return material


def object_vector(graph: Graph, **mapping: tuple[float, float, float]) -> bpy.types.NodeSocket:
    """The object's own coordinates through a mapping of ``Location``, ``Rotation``, ``Scale``."""
    source = graph.node("ShaderNodeTexCoord").outputs["Object"]
    return graph.node("ShaderNodeMapping", {"Vector": source, **mapping}).outputs["Vector"]


def between(graph: Graph, share: bpy.types.NodeSocket, low: tuple[float, ...], high: tuple[float, ...],
            sharp: bool = False) -> bpy.types.NodeSocket:
    """Colour from ``low`` to ``high`` as ``share`` goes from 0.4 to 0.6, or jumps in the middle."""
    ramp = graph.node("ShaderNodeValToRGB", {0: share})
    first, second = ramp.color_ramp.elements
    first.position, second.position = (0.0, 0.5) if sharp else (0.4, 0.6)
    first.color, second.color = (*low, 1.0), (*high, 1.0)
    ramp.color_ramp.interpolation = "CONSTANT" if sharp else "LINEAR"
    return ramp.outputs["Color"]


def board(name: str, y: float, half: tuple[float, float], material: bpy.types.Material) -> bpy.types.Object:
    """Upright rectangle at depth ``y`` of half-sizes (x, z), facing the viewer; its coordinates are lens pitches."""
    (x, z) = half
    corners = np.array([(-x, 0, -z), (x, 0, -z), (x, 0, z), (-x, 0, z)])
    thing = add_surface(Surface(corners, np.array([[0, 1, 2, 3]]), smooth=False), material, name)
    thing.location = (0.0, y, 0.0)
    return thing


def put(name: str, surface: Surface, material: bpy.types.Material, at: tuple[float, float, float],
        size: float = 1.0) -> bpy.types.Object:
    """Object of a surface at a place, scaled."""
    thing = add_surface(surface, material, name)
    thing.location, thing.scale = at, (size,) * 3
    return thing


def twin(thing: bpy.types.Object, at: tuple[float, float, float], size: float = 1.0) -> bpy.types.Object:
    """Another object of the same mesh."""
    other = thing.copy()
    bpy.context.scene.collection.objects.link(other)
    other.location, other.scale = at, (size,) * 3
    return other


def to_background(thing: bpy.types.Object) -> None:
    """Move an object to the collection that is not foreground."""
    collection = bpy.data.collections.get(subject.BACKGROUND_COLLECTION)
    if collection is None:
        collection = bpy.data.collections.new(subject.BACKGROUND_COLLECTION)
        bpy.context.scene.collection.children.link(collection)
    for owner in list(thing.users_collection):
        owner.objects.unlink(thing)
    collection.objects.link(thing)


def turned(thing: bpy.types.Object, degrees: tuple[float, float, float]) -> bpy.types.Object:
    """The object, turned by Euler angles."""
    thing.rotation_euler = tuple(math.radians(angle) for angle in degrees)
    return thing
