"""What every part of a training scene is built on: the random stream, the display window, the notes.

World axes: X right, Z up, Y away from the viewer; the display plane is y = 0 with
half-width 1, the viewer at y = -distance.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from training_parts.surfaces import Surface

from lfsr_core.display import DisplayProfile
from lfsr_core.rays import CameraArray

DEPTH_EXCESS = 1.5  # how far beyond the usable depth range objects may stand
DEEPEST, NEAREST = 3.0, 0.55  # limits in display half-widths and in viewing distances


@dataclasses.dataclass
class Dimmer:
    """One strength to multiply when the exposure is set: ``owner.attribute``."""

    owner: Any
    attribute: str

    def scale(self, factor: float) -> None:
        """Multiply the strength."""
        setattr(self.owner, self.attribute, getattr(self.owner, self.attribute) * factor)


@dataclasses.dataclass
class Stage:
    """``front`` and ``behind``: how far objects may stand from the display plane, in scene units.

    ``pitch``: how far the camera array has climbed about the display's middle, radians.
    """

    rng: np.random.Generator
    profile: DisplayProfile
    array: CameraArray
    front: float
    behind: float
    textures: tuple[Path, ...]
    layout: str = ""
    pitch: float = 0.0
    notes: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    dimmers: list[Dimmer] = dataclasses.field(default_factory=list)

    @classmethod
    def for_display(cls, rng: np.random.Generator, profile: DisplayProfile, scale: int,
                    textures: tuple[Path, ...]) -> Stage:
        """Stage whose depth is a random share, up to 1.5, of the low-resolution array's usable range."""
        array = CameraArray.for_display(profile, 2.0)
        unit = 2.0 / profile.panel_mm[0]
        front, behind = (unit * depth for depth in profile.depth_range_mm(scale))
        share = DEPTH_EXCESS * rng.uniform(0.25, 1)
        return cls(rng, profile, array, min(front * share, NEAREST * array.distance),
                   min(behind * share, DEEPEST), textures)

    @property
    def matrix_world(self) -> tuple[tuple[float, ...], ...]:
        """Camera-array space (+X right, +Y up, +Z to the display) to world, row by row."""
        sine, cosine, distance = math.sin(self.pitch), math.cos(self.pitch), self.array.distance
        return ((1.0, 0.0, 0.0, 0.0), (0.0, sine, cosine, -distance * cosine),
                (0.0, cosine, -sine, distance * sine), (0.0, 0.0, 0.0, 1.0))

    def note(self, what: str, **facts: Any) -> None:
        """Record one decision for the scene's description."""
        plain = {key: [round(float(v), 4) for v in value] if isinstance(value, (np.ndarray, tuple)) else
                 round(value, 4) if isinstance(value, float) else value for key, value in facts.items()}
        self.notes.append({"what": what, **plain})

    def window(self, depth: float, widen: float = 0.0) -> tuple[float, float]:
        """Half-width and half-height that the central view sees at y = depth.

        ``widen`` = 1 gives what the outermost views see together.
        """
        near = (self.array.distance + depth) / self.array.distance
        reach = widen * abs(depth) / self.array.distance * self.array.spacing / 2
        return (self.array.half_width * near + reach * self.profile.views[0],
                self.array.half_height * near + reach * self.profile.views[1])

    def depth(self) -> float:
        """Random y, more often near the display plane than at the limits."""
        return float(self.rng.triangular(-self.front, 0, self.behind))

    def place(self, margin: float = 0.9) -> np.ndarray:
        """Random point in the viewing frustum."""
        depth = self.depth()
        width, height = self.window(depth)
        return np.array([self.rng.uniform(-width, width) * margin, depth, self.rng.uniform(-height, height) * margin])

    def chance(self, probability: float) -> bool:
        """True with the given probability."""
        return bool(self.rng.random() < probability)

    def log_uniform(self, low: float, high: float) -> float:
        """Random value whose logarithm is uniform."""
        return float(math.exp(self.rng.uniform(math.log(low), math.log(high))))

    def pick(self, weights: dict[str, float]) -> str:
        """One key, chosen by weight."""
        share = np.array(list(weights.values()), float)
        return list(weights)[self.rng.choice(len(weights), p=share / share.sum())]


def add_surface(surface: Surface, material: bpy.types.Material | None, name: str = "part") -> bpy.types.Object:
    """Object of a surface in the scene, with its texture coordinates and one material."""
    mesh = bpy.data.meshes.new(name)
    count, corners = surface.faces.shape
    mesh.vertices.add(len(surface.vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(surface.vertices, np.float32).ravel())
    mesh.loops.add(count * corners)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(surface.faces, np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, count * corners, corners, dtype=np.int32))
    mesh.update(calc_edges=True)
    if surface.uv is not None:
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", np.ascontiguousarray(surface.uv[surface.faces.ravel()], np.float32).ravel())
    mesh.polygons.foreach_set("use_smooth", np.full(count, surface.smooth))
    return add_object(mesh, material, name)


def add_object(data: bpy.types.ID, material: bpy.types.Material | None, name: str) -> bpy.types.Object:
    """Object of a mesh, curve or light in the scene's own collection."""
    thing = bpy.data.objects.new(name, data)
    if material is not None:
        data.materials.append(material)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def settle(thing: bpy.types.Object, at: np.ndarray, size: float | np.ndarray, turn: np.ndarray) -> None:
    """Place, scale and rotate (Euler angles in radians)."""
    thing.location, thing.rotation_euler = at, turn
    thing.scale = np.broadcast_to(size, 3)
