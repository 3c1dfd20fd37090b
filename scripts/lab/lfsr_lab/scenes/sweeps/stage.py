"""Generated scenes of the studies: the camera array, materials and boards, and the script that writes them.

World axes: X right, Z up, Y away from the viewer. One unit is one lens pitch, the
display plane is y = 0, see lfsr_lab.experiments.sweeps.sweeps.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from blender_addon.scene import contents
from blender_addon.scene.array import edit
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray
from lfsr_core.process.child import emit
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import Graph, leave, principled, put, run, save
from lfsr_lab.scenes.sweeps.space import Space


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
        edit.put(scene, profile, (array, matrix))
        return cls(Space.of(profile, scale), frames, np.random.default_rng(7))


def glow(name: str, color: Any, strength: float) -> bpy.types.Material:
    """Material that shines and reflects nothing; ``color`` a colour or a function of the graph that gives one."""
    material, graph, shader = principled(name, Base_Color=(0.0, 0.0, 0.0, 1.0), Roughness=1.0, Specular_IOR_Level=0.0,
                                         Emission_Strength=strength)
    graph.feed(shader.inputs["Emission Color"], color(graph) if callable(color) else (*color, 1.0))
    return material


def object_vector(graph: Graph, **mapping: tuple[float, float, float]) -> bpy.types.NodeSocket:
    """The object's own coordinates through a mapping of ``Location``, ``Rotation``, ``Scale``."""
    source = graph.node("ShaderNodeTexCoord").outputs["Object"]
    return graph.node("ShaderNodeMapping", {"Vector": source, **mapping}).outputs["Vector"]


def between(graph: Graph, fraction: bpy.types.NodeSocket, low: tuple[float, ...], high: tuple[float, ...],
            sharp: bool = False) -> bpy.types.NodeSocket:
    """Colour from ``low`` to ``high`` as ``fraction`` goes from 0.4 to 0.6, or jumps in the middle."""
    ramp = graph.node("ShaderNodeValToRGB", {0: fraction})
    first, second = ramp.color_ramp.elements
    first.position, second.position = (0.0, 0.5) if sharp else (0.4, 0.6)
    first.color, second.color = (*low, 1.0), (*high, 1.0)
    ramp.color_ramp.interpolation = "CONSTANT" if sharp else "LINEAR"
    return ramp.outputs["Color"]


def board(name: str, y: float, half: tuple[float, float], material: bpy.types.Material) -> bpy.types.Object:
    """Upright rectangle at depth ``y`` of half-sizes (x, z), facing the viewer; its coordinates are lens pitches."""
    x, z = half
    return put(surfaces.card(x, z), material, (0.0, y, 0.0), name=name)


def to_background(thing: bpy.types.Object) -> None:
    """Move an object to the collection that is not foreground."""
    collection = bpy.data.collections.get(contents.BACKGROUND_COLLECTION)
    if collection is None:
        collection = bpy.data.collections.new(contents.BACKGROUND_COLLECTION)
        bpy.context.scene.collection.children.link(collection)
    for owner in list(thing.users_collection):
        owner.objects.unlink(thing)
    collection.objects.link(thing)


def turned(thing: bpy.types.Object, degrees: tuple[float, float, float]) -> bpy.types.Object:
    """The object, turned by Euler angles."""
    thing.rotation_euler = tuple(math.radians(angle) for angle in degrees)
    return thing


def write_scenes(builders: Mapping[str, Callable[[Stage, float], None]]) -> None:
    """Write the scenes of the JSON file that the script's last argument names, then end Blender's process.

    The file holds "display" (a profile), "scale", "frames" and "scenes": objects of "name" (of ``builders``), "path",
    and "value" where one is varied.
    """
    def build(data: dict[str, Any]) -> None:
        profile = DisplayProfile.from_dict(data["display"])
        for number, entry in enumerate(data["scenes"]):
            name, value = entry["name"], entry.get("value", 0.0)
            emit(stage="scene", fraction=number / len(data["scenes"]), message=f"{name} {value:g}")
            builders[name](Stage.empty(profile, data["scale"], data["frames"]), value)
            bpy.context.scene.frame_set(1)
            save(Path(entry["path"]))

    leave(run(build, "a list of scenes"))
