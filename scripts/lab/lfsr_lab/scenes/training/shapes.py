"""Objects of the training scenes, each about 2 across before it is placed."""

from __future__ import annotations

import dataclasses
import math
import string
from collections.abc import Callable, Iterator

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import add_object, add_surface, settle
from lfsr_lab.scenes.shared.surfaces import Random, Surface
from lfsr_lab.scenes.training.materials import random_material
from lfsr_lab.scenes.training.models import glaze, load_model
from lfsr_lab.scenes.training.stage import Stage

MAX_BRANCHES = 500
Plant = tuple[Surface, Surface | None]  # wood and leaves, which differ in material


def tree(rng: Random) -> Plant:
    """A branching tree, trunk base at (0, 0, -1), about 2 high."""
    branches: list[tuple[Array, Array]] = []
    spread, shrink = rng.uniform(0.3, 0.8), rng.uniform(0.62, 0.8)
    todo = [(np.array([0, 0, -1.0]), np.array([0, 0, 1.0]), rng.uniform(0.4, 0.7), rng.uniform(0.03, 0.08), 0)]
    while todo and len(branches) < MAX_BRANCHES:
        start, along, length, radius, level = todo.pop(0)
        part = np.linspace(0, 1, 6)[:, None]
        path = start + along * length * part + rng.normal(0, 0.12, 3) * length * part ** 2
        branches.append((path, np.linspace(radius, radius * shrink, len(path))))
        if level < 6 and length > 0.08:
            for _ in range(rng.integers(2, 4)):
                turn = along + rng.normal(0, spread, 3)
                fork = path[-1] if rng.random() < 0.7 else path[rng.integers(2, len(path))]
                todo.append((fork, turn / np.linalg.norm(turn), length * shrink * rng.uniform(0.8, 1.1),
                             radius * shrink * 0.85, level + 1))
    paths, radii = (np.array(part) for part in zip(*branches, strict=True))
    wood, tips = surfaces.strands(paths, radii, 6), paths[len(paths) // 4:, -1]
    return wood, (leaves(rng, tips, int(rng.integers(300, 1800))) if rng.random() < 0.85 else None)


def leaves(rng: Random, places: Array, count: int) -> Surface:
    """``count`` small quads with a full texture square each, scattered about the given places."""
    size = rng.uniform(0.03, 0.1) * rng.uniform(0.6, 1.2, (count, 1))
    centre = places[rng.integers(len(places), size=count)] + rng.normal(0, 0.06, (count, 3))
    first = _units(rng.normal(size=(count, 3)))
    second = _units(np.cross(first, rng.normal(size=(count, 3))))
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    flat = corner[:, :1] * first[:, None] * 0.6 + corner[:, 1:] * second[:, None]
    vertices = centre[:, None] + size[:, None] * flat
    faces = np.arange(count * 4).reshape(-1, 4)
    return Surface(vertices.reshape(-1, 3), faces, np.tile((corner + 1) / 2, (count, 1)), False)


def _units(vectors: Array) -> Array:
    return vectors / (np.linalg.norm(vectors, axis=-1, keepdims=True) + 1e-9)


def flower(rng: Random) -> Plant:
    """A stem from (0, 0, -1) and a blossom of curved petals at its upper end."""
    part = np.linspace(0, 1, 12)
    lean = rng.normal(0, 0.25, 2)
    path = np.stack([lean[0] * part ** 2, lean[1] * part ** 2, 2 * part - 1], -1)
    blossom = _blossom(rng, rng.uniform(0.15, 0.4))
    axis, angle = rng.normal(size=3), rng.normal(0, 0.5)
    tilt = np.array(Matrix.Rotation(angle, 3, axis))
    petals = dataclasses.replace(blossom, vertices=blossom.vertices @ tilt.T + path[-1])
    return surfaces.tube(path, rng.uniform(0.01, 0.03), 6), petals


def _blossom(rng: Random, size: float) -> Surface:
    count, curl, width = int(rng.integers(5, 22)), rng.uniform(-0.8, 1.4), rng.uniform(0.2, 0.6)
    petals = []
    for index in range(count):
        angle = index * 2.399963 + rng.normal(0, 0.1)
        open_by = rng.uniform(0.1, 1.0)

        def place(u: Array, v: Array, angle: float = angle, open_by: float = open_by) -> Array:
            across = (u - 0.5) * width * np.sin(np.pi * np.clip(v * 0.9 + 0.05, 0, 1)) * 2
            lift = (1 - open_by) * v + curl * v ** 2 * 0.4 + 0.3 * across ** 2
            x, y = v * np.cos(angle) - across * np.sin(angle), v * np.sin(angle) + across * np.cos(angle)
            return size * np.stack([x, y, lift], -1)

        petals.append(surfaces.parametric(place, 6, 10))
    return surfaces.join(petals)


def fur(rng: Random, body: Surface, more: int = 1, thinner: float = 1.0) -> Surface:
    """Hair on a body: thin, tapered, drooping tubes along its rough outward direction.

    ``more``, ``thinner``: factors of the number of hairs and of their thickness.
    """
    count, length = int(rng.integers(300, 1200)) * more, rng.uniform(0.1, 0.6)
    thickness = rng.uniform(0.003, 0.012) * thinner
    roots = body.vertices[rng.integers(len(body.vertices), size=count)]
    part = np.linspace(0, 1, 5)
    wind = rng.normal(0, 0.4, 3) - [0, 0, rng.uniform(0, 0.8)]
    out = _units(roots) + rng.normal(0, 0.2, roots.shape)
    paths = roots[:, None] + length * (part[:, None] * out[:, None] + (part ** 2)[:, None] * wind)
    return surfaces.strands(paths, thickness * (1.05 - part))


def grass(rng: Random, half_width: float, half_depth: float) -> Surface:
    """A meadow of bent blades standing on z = 0."""
    count, height = int(rng.integers(300, 1500)), rng.uniform(0.1, 0.5)
    part, width = np.linspace(0, 1, 4), rng.uniform(0.004, 0.02)
    root = np.column_stack([rng.uniform(-half_width, half_width, count), rng.uniform(-half_depth, half_depth, count),
                            np.zeros(count)])
    bend = rng.normal(0, 0.25, (count, 1, 3)) * [1, 1, 0]
    blade = part[:, None] * [0, 0, 1] + (part ** 2)[:, None] * bend
    paths = root[:, None] + height * rng.uniform(0.5, 1, (count, 1, 1)) * blade
    return surfaces.strands(paths, width * (1.05 - part))


SHAPES: dict[str, float] = {"blob": 22, "ball": 8, "box": 8, "superquadric": 9, "knot": 10, "lathe": 10, "gear": 6,
                            "spring": 4, "wire": 5, "rock": 6, "monkey": 7, "text": 5, "lattice": 4, "fur": 2}
SMALL = {name: weight for name, weight in SHAPES.items() if name not in ("fur", "text")}
CLOSED = {"blob", "ball", "box", "superquadric", "knot", "lathe", "gear", "rock"}
SURFACES: dict[str, Callable[[Random], Surface]] = {
    "blob": surfaces.blob, "superquadric": surfaces.superquadric, "knot": surfaces.torus_knot,
    "spring": surfaces.spring, "wire": surfaces.wire_tangle, "lathe": surfaces.lathe, "gear": surfaces.gear,
    "ball": lambda rng: surfaces.sphere(), "box": lambda rng: surfaces.box(*rng.uniform(0.4, 1, 3)),
    "fur": lambda rng: fur(rng, surfaces.sphere(40, 24))}


def random_shape(stage: Stage, kind: str | None = None, material: bpy.types.Material | None = None) -> bpy.types.Object:
    """Return an object of a random or given kind with a random or given material, at the origin."""
    kind = kind or stage.pick(kinds(stage))
    if kind == "model":
        return _model(stage, material)
    stage.note("shape", kind=kind)
    material = material or random_material(stage, closed=kind in CLOSED, uv=kind in SURFACES)
    if kind in SURFACES:
        return add_surface(surfaces.unit_sized(SURFACES[kind](stage.rng)), material, kind)
    return {"monkey": _monkey, "text": _text, "rock": _rock, "lattice": _lattice}[kind](stage, material)


def kinds(stage: Stage, small: bool = False) -> dict[str, float]:
    """Return the kinds of shapes by weight, with models if there are any; ``small``: those that may be many."""
    return (SMALL if small else SHAPES) | ({"model": 130} if stage.models else {})


def _model(stage: Stage, material: bpy.types.Material | None) -> bpy.types.Object:
    """A real model, mostly in its own materials."""
    path = list(stage.models)[stage.rng.integers(len(stage.models))]
    thing = load_model(path)
    if material or stage.chance(0.15):
        material = material or random_material(stage, closed=False, uv=False)
        for slot in range(len(thing.data.materials)):
            thing.data.materials[slot] = material
    elif stage.chance(0.6):
        glaze(thing)
    stage.note("model", **stage.models[path])
    return thing


def put(stage: Stage, thing: bpy.types.Object, at: Array, size: float | Array,
        turned: Array | None = None) -> bpy.types.Object:
    """Place an object, turned at random unless ``turned`` is given, and note where."""
    settle(thing, at, size, turn(stage) if turned is None else turned)
    stage.note("put", name=thing.name.split(".")[0], at=np.asarray(at, float), size=float(np.max(size)))
    return thing


def copies(stage: Stage, bodies: list[bpy.types.Object], least: int, limit: int) -> Iterator[bpy.types.Object]:
    """Yield ``least`` to ``limit`` - 1 objects: each body once, then copies, which share the bodies' meshes."""
    for index in range(stage.rng.integers(least, limit)):
        if index < len(bodies):
            yield bodies[index]
        else:
            twin = bodies[stage.rng.integers(len(bodies))].copy()
            bpy.context.scene.collection.objects.link(twin)
            yield twin


def _bmesh_object(work: bmesh.types.BMesh, material: bpy.types.Material, name: str) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    work.to_mesh(mesh)
    work.free()
    return add_object(mesh, material, name)


def _monkey(stage: Stage, material: bpy.types.Material) -> bpy.types.Object:
    work = bmesh.new()
    bmesh.ops.create_monkey(work)
    for face in work.faces:
        face.smooth = True
    thing = _bmesh_object(work, material, "monkey")
    smoother = thing.modifiers.new("smooth", "SUBSURF")
    smoother.levels = smoother.render_levels = int(stage.rng.integers(0, 4))
    return thing


def _rock(stage: Stage, material: bpy.types.Material) -> bpy.types.Object:
    """A faceted stone: a ball cut by random planes."""
    rng, work = stage.rng, bmesh.new()
    bmesh.ops.create_icosphere(work, subdivisions=int(rng.integers(2, 4)), radius=1.0)
    points = np.array([vertex.co for vertex in work.verts])
    for direction in rng.normal(size=(rng.integers(3, 14), 3)):
        direction /= np.linalg.norm(direction)
        over = np.maximum(points @ direction - rng.uniform(0.45, 0.8), 0)
        points -= over[:, None] * direction
    for vertex, point in zip(work.verts, points * rng.uniform(0.6, 1, 3), strict=True):
        vertex.co = point
    return _bmesh_object(work, material, "rock")


def _lattice(stage: Stage, material: bpy.types.Material) -> bpy.types.Object:
    """Struts along the edges of a ball or a box."""
    rng, work = stage.rng, bmesh.new()
    if rng.random() < 0.6:
        bmesh.ops.create_icosphere(work, subdivisions=int(rng.integers(1, 4)), radius=1.0)
    else:
        bmesh.ops.create_cube(work, size=2.0)
        bmesh.ops.subdivide_edges(work, edges=work.edges, cuts=int(rng.integers(1, 4)), use_grid_fill=True)
    thing = _bmesh_object(work, material, "lattice")
    thing.modifiers.new("struts", "WIREFRAME").thickness = stage.log_uniform(0.015, 0.12)
    return thing


def _text(stage: Stage, material: bpy.types.Material) -> bpy.types.Object:
    """Raised letters and digits in one to three lines, about 2 across, standing upright."""
    rng, curve = stage.rng, bpy.data.curves.new("text", "FONT")
    letters = list(string.ascii_letters + string.digits + "&?!%#@")
    lines = ["".join(rng.choice(letters, rng.integers(1, 9))) for _ in range(rng.integers(1, 4))]
    curve.body, curve.align_x, curve.align_y = "\n".join(lines), "CENTER", "CENTER"
    curve.size = 2.0 / max(len(line) for line in lines) * 1.6
    curve.extrude, curve.bevel_depth = stage.log_uniform(0.02, 0.2), stage.log_uniform(0.002, 0.02)
    curve.resolution_u = 4
    return add_object(curve, material, "text")


def turn(stage: Stage) -> Array:
    """Random Euler angles in radians."""
    return stage.rng.uniform(-math.pi, math.pi, 3)


def upright(stage: Stage, lean: float = 0.2) -> Array:
    """Angles that turn an object about the vertical and lean it a little."""
    return np.array([*stage.rng.normal(0, lean, 2), stage.rng.uniform(-math.pi, math.pi)])


def readable(stage: Stage) -> Array:
    """Angles that stand a text upright before the viewer."""
    return np.array([math.pi / 2, 0, 0]) + stage.rng.normal(0, 0.35, 3)
