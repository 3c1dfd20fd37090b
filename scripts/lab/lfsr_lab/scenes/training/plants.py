"""Thin things: trees with leaves, flowers, grass, hair."""

from __future__ import annotations

import dataclasses

import numpy as np
from mathutils import Matrix

from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.surfaces import Random, Surface

MAX_BRANCHES = 500
Plant = tuple[Surface, Surface | None]  # wood and leaves, which differ in material


def tree(rng: Random) -> Plant:
    """A branching tree, trunk base at (0, 0, -1), about 2 high."""
    branches: list[tuple[Array, Array]] = []
    spread, shrink = rng.uniform(0.3, 0.8), rng.uniform(0.62, 0.8)
    todo = [(np.array([0, 0, -1.0]), np.array([0, 0, 1.0]), rng.uniform(0.4, 0.7), rng.uniform(0.03, 0.08), 0)]
    while todo and len(branches) < MAX_BRANCHES:
        start, along, length, radius, level = todo.pop(0)
        path = _bent(rng, start, along, length)
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


def _bent(rng: Random, start: Array, along: Array, length: float) -> Array:
    part = np.linspace(0, 1, 6)[:, None]
    return start + along * length * part + rng.normal(0, 0.12, 3) * length * part ** 2


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
