"""Surfaces and other data as objects in the open scene."""

from __future__ import annotations

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared.surfaces import Surface

Vector = Array | tuple[float, ...]  # three values


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


def put(surface: Surface, material: bpy.types.Material | None, at: Vector, size: float | Vector = 1.0,
        turn: Vector = (0, 0, 0), name: str = "part") -> bpy.types.Object:
    """Add an object of a surface and ``settle`` it."""
    thing = add_surface(surface, material, name)
    settle(thing, at, size, turn)
    return thing


def again(thing: bpy.types.Object, at: Vector, size: float | Vector = 1.0,
          turn: Vector = (0, 0, 0)) -> bpy.types.Object:
    """Add another object of the same mesh and ``settle`` it."""
    other = add_object(thing.data, None, thing.name)
    settle(other, at, size, turn)
    return other


def settle(thing: bpy.types.Object, at: Vector, size: float | Vector, turn: Vector) -> None:
    """Place, scale and rotate (Euler angles in radians)."""
    thing.location, thing.rotation_euler = at, turn
    thing.scale = np.broadcast_to(size, 3)
