"""Bodies, boards, prints and wires of the parameter sweeps."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.graph import Graph, paint, principled
from lfsr_lab.scenes.shared.objects import again, put
from lfsr_lab.scenes.shared.surfaces import Surface
from lfsr_lab.scenes.sweeps.stage import Stage, between, object_vector

BODY_SIZE = 0.95  # radius in lenses
JITTER = 0.35


@dataclasses.dataclass(frozen=True)
class Grid:
    """How points are spread, in lenses seen from the viewing position."""

    cell: float = 2.5  # from point to point
    reach: tuple[float, float] | None = None  # to either side of the middle, None for all that any view sees


def lattice(stage: Stage, low: float, high: float, grid: Grid) -> Iterator[tuple[Array, float]]:
    """(place, lens size there) of scattered points between depths ``low`` and ``high``."""
    cell, reach = grid.cell, grid.reach
    space, rng = stage.space, stage.rng
    limits = [max(space.window(y)[axis] / space.magnified(y) for y in (low, high)) + cell for axis in (0, 1)]
    columns, rows = (int((reach or limits)[axis] / cell) for axis in (0, 1))
    for column, row in itertools.product(range(-columns, columns + 1), range(-rows, rows + 1)):
        y, (dx, dz) = rng.uniform(low, high) if high > low else low, rng.uniform(-JITTER, JITTER, 2)
        size = space.magnified(y)
        shifted = column + 0.5 * (row % 2)
        yield np.array([(shifted * cell + dx) * size, y, (row * cell + dz) * size]), size


def bodies(stage: Stage, low: float, high: float, materials: Sequence[bpy.types.Material],
           grid: Grid = Grid()) -> list[bpy.types.Object]:
    """Balls, boxes, rings and pillows of the given materials between two depths."""
    kinds = [put(shape, material, (0, 0, 0), name=f"body {index}")
             for index, (shape, material) in enumerate(zip(itertools.cycle(_shapes(stage)), materials, strict=False))]
    made = [again(kinds[index % len(kinds)], place, size * BODY_SIZE, np.radians(stage.rng.uniform(0, 180, 3)))
            for index, (place, size) in enumerate(lattice(stage, low, high, grid))]
    for kind in kinds:
        bpy.data.objects.remove(kind)
    return made


def _shapes(stage: Stage) -> list[Surface]:
    ring = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    circle = np.stack([np.cos(ring), np.sin(ring), 0 * ring], -1) * 0.7
    return [surfaces.sphere(), surfaces.unit_sized(surfaces.box(0.7, 0.6, 0.5)),
            surfaces.tube(circle, 0.28, 16, closed=True), surfaces.superquadric(stage.rng)]


def print_of(graph: Graph, scale: float) -> bpy.types.NodeSocket:
    """Colours of a detailed print; its coarsest parts are 1 / ``scale`` across."""
    vector = object_vector(graph)
    coarse = graph.node("ShaderNodeTexNoise", {"Vector": vector, "Scale": scale, "Detail": 4.0, "Roughness": 0.7})
    cells = graph.node("ShaderNodeTexVoronoi", {"Vector": vector, "Scale": scale * 2})
    mix = graph.node("ShaderNodeMix", data_type="RGBA")
    first, second = (socket for socket in mix.inputs if socket.type == "RGBA")
    graph.feed(mix.inputs[0], coarse.outputs[0])
    graph.feed(first, between(graph, coarse.outputs[0], (0.03, 0.08, 0.3), (0.9, 0.6, 0.2)))
    graph.feed(second, between(graph, cells.outputs["Distance"], (0.6, 0.05, 0.04), (0.85, 0.9, 0.8), sharp=True))
    return next(socket for socket in mix.outputs if socket.type == "RGBA")


def printed(name: str, scale: float, **inputs: float) -> bpy.types.Material:
    """Matt material with a detailed print."""
    material, graph, shader = principled(name, **{"Roughness": 1.0, "Specular_IOR_Level": 0.0} | inputs)
    graph.feed(shader.inputs["Base Color"], print_of(graph, scale))
    return material


def tiles(graph: Graph, size: tuple[float, float], dark: tuple[float, ...], bright: tuple[float, ...],
          offset: tuple[float, float, float] = (0.0, 0.5, 0.0)) -> bpy.types.NodeSocket:
    """Checkerboard colours of tiles of ``size`` (x, z); ``offset`` in tiles, the middle of one along y."""
    vector = object_vector(graph, Location=offset, Scale=(1 / size[0], 1 / size[0], 1 / size[1]))
    return graph.node("ShaderNodeTexChecker", {"Vector": vector, "Scale": 1.0, "Color1": (*bright, 1.0),
                                               "Color2": (*dark, 1.0)}).outputs["Color"]


def every_sort() -> list[bpy.types.Material]:
    """Printed, glossy, metal, glass and plain surfaces."""
    return [printed("print", 1.5), paint("plastic", (0.05, 0.2, 0.65), 0.15),
            paint("gold", (1.0, 0.7, 0.3), 0.25, Metallic=1.0), glass(1.45, 0.0),
            printed("fine print", 4.0, Roughness=0.4, Specular_IOR_Level=0.5), paint("white", (0.8, 0.8, 0.75))]


def opaque_sorts() -> list[bpy.types.Material]:
    """Printed and plain surfaces, nothing that shows something else's depth."""
    return [printed("print", 1.5), paint("matt blue", (0.05, 0.2, 0.65), 0.9),
            printed("fine print", 4.0), paint("white", (0.8, 0.8, 0.75), 0.9)]


def dark_sorts() -> list[bpy.types.Material]:
    """Surfaces that reflect a fiftieth of the light, matt, glossy and of metal."""
    return [paint("soot", (0.02, 0.02, 0.02), 1.0, Specular_IOR_Level=0.0), paint("lacquer", (0.02, 0.01, 0.01), 0.1),
            paint("iron", (0.02, 0.02, 0.025), 0.4, Metallic=1.0), paint("navy", (0.01, 0.015, 0.04), 0.8)]


def flakes(stage: Stage, low: float, high: float, half: float, per_lens: float) -> Surface:
    """Square flakes of half a side ``half``, turned at random, ``per_lens`` of them in each lens, as one surface."""
    space, rng = stage.space, stage.rng
    reach = np.array([max(space.window(y)[axis] / space.magnified(y) for y in (low, high)) for axis in (0, 1)])
    count = max(1, round(per_lens * 4 * math.prod(reach) / space.row))
    y = rng.uniform(low, high, count)
    size = np.vectorize(space.magnified)(y)
    x, z = (rng.uniform(-1, 1, count) * reach[axis] * size for axis in (0, 1))
    turns = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]  # two of three axes at right angles span a flake
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    offsets = size[:, None, None] * np.einsum("cu,nku->nck", corners, turns[..., :2])
    vertices = np.stack([x, y, z], -1)[:, None] + offsets
    return Surface(vertices.reshape(-1, 3), np.arange(4 * count).reshape(-1, 4), smooth=False)


def glass(index: float, roughness: float) -> bpy.types.Material:
    """Clear glass."""
    return paint("glass", (0.97, 0.99, 0.98), roughness, Transmission_Weight=1.0, IOR=index)


def wires(stage: Stage, y: float, thickness: float, material: bpy.types.Material) -> list[bpy.types.Object]:
    """Straight crossing wires at depth ``y`` that reach across all that any view sees."""
    width, height = stage.space.window(y)
    step = 2.2 * stage.space.magnified(y)
    made = []
    for degrees in (10.0, 100.0, 55.0):
        along = np.array([math.cos(math.radians(degrees)), 0.0, math.sin(math.radians(degrees))])
        across = np.array([-along[2], 0.0, along[0]])
        length = math.hypot(width, height) + step
        every = step * (2 if degrees == 55.0 else 1)
        for index in range(-int(length / every), int(length / every) + 1):
            place = across * every * (index + 0.3)
            path = np.stack([place - along * length, place + along * length])
            made.append(put(surfaces.tube(path, thickness / 2, 16), material, (0.0, y, 0.0), name="wire"))
    return made
