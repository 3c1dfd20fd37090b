"""Rooms: whether what surrounds a place encloses it, and where in a room the array stands with the longest view."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import bpy
import mathutils
import numpy as np

from lfsr_core.base.arrays import Array

from .placement import MOST_REACH, PROBES, Rays, View
from .rig import Placement

GRID, HEIGHT, MARGIN = 5, 0.5, 0.15  # places across the bounding box, at half of its height, away from its sides
YAWS = 12  # directions of view at each place
HALF_WIDTH = 0.6  # of the view at distance 1: about 62°
ACROSS, DOWN = 7, 3  # rays of a view
ENCLOSED, FACING, LEAST_PLACES = 0.95, 0.6, 3  # least fractions of rays that hit, and that hit a front
WALLS = 1000  # most polygons of a room whose walls face outwards
# Where walls are, from the middle of the box of what stands in a room, in its sizes: 0.5 is its side.
SIDE, WIDE, BOXY = 0.42, 2.0, 0.5  # the fraction of rays that must end there at least
NEAR = 0.15  # of the median depth of a view, at which nothing may stand in its way
AROUND = [mathutils.Vector(way).normalized() for way in itertools.product((-1, 0, 1), repeat=3) if any(way)]

Hit = tuple[mathutils.Vector, bool, bpy.types.Object]  # place, whether the front of a surface is hit, what is hit
Box = tuple[Array, Array]  # lowest and highest world corner (3,)


def cast(rays: Rays, start: mathutils.Vector, ways: Iterable[mathutils.Vector]) -> list[Hit | None]:
    """Return what rays from ``start`` meet first."""
    hits = ((rays.cast(start, way), way) for way in ways)
    return [(hit[0], hit[1].dot(way) < 0, hit[2]) if hit else None for hit, way in hits]


def through(rays: Rays, placed: Placement, across: int = PROBES[0], down: int = PROBES[1]) -> list[Hit | None]:
    """Return what rays from the middle of a ``placed`` array, spread over its display, meet first."""
    array, eye = placed[0], mathutils.Matrix(placed[1])
    half = array.half_width / array.distance, array.half_height / array.distance
    return cast(rays, eye.translation, [eye.to_3x3() @ mathutils.Vector((x * half[0], y * half[1], 1))
                                        for x in np.linspace(-1, 1, across) for y in np.linspace(-1, 1, down)])


def is_inside(rays: Rays, place: mathutils.Vector, box: Box | None = None) -> bool:
    """Return True if ``place`` is in a room: closed on all sides, by walls that face it or that hold other things.

    With the bounding ``box`` of what stands there only if most walls lie at its sides or not far beyond them, and
    something stands between them: else it is the inside of a solid thing, or of a dome.
    """
    hits = cast(rays, place, AROUND)
    met = [hit for hit in hits if hit is not None]
    if len(met) < ENCLOSED * len(hits):
        return False
    if box is not None:
        low, size = box[0], np.maximum(box[1] - box[0], 1e-9)
        middle = np.abs((np.array([hit[0] for hit in met]) - low) / size - 0.5).max(1)  # 0.5 at the box's sides
        if (np.median(middle) > WIDE or (middle > SIDE).mean() < BOXY
                or not (middle < SIDE).any()):
            return False
    if sum(faces for _, faces, _ in met) >= FACING * len(met):
        return True
    walls = {item for _, faces, item in met if not faces}
    return (all(item.type == "MESH" and len(item.data.polygons) < WALLS for item in walls)
            and any(faces and item not in walls for _, faces, item in met))


def view_of_room(rays: Rays, low: Array, high: Array) -> View | None:
    """Return the longest free view inside a box of world corners ``low``, ``high`` (3,); None where that is no room."""
    size = high - low
    shares = np.linspace(MARGIN, 1 - MARGIN, GRID)
    places = [mathutils.Vector((*(low[:2] + size[:2] * (x, y)), low[2] + HEIGHT * size[2]))
              for x, y in itertools.product(shares, repeat=2)]
    inside = [place for place in places if is_inside(rays, place, (low, high))]
    if len(inside) < LEAST_PLACES:
        return None
    best, most = None, 0.0
    for place, step in itertools.product(inside, range(YAWS)):
        turn = mathutils.Euler((math.pi / 2, 0, math.tau * step / YAWS)).to_matrix()
        ways = [turn @ mathutils.Vector((x, y, -1)) for x in np.linspace(-HALF_WIDTH, HALF_WIDTH, ACROSS)
                for y in np.linspace(-HALF_WIDTH / 2, HALF_WIDTH / 2, DOWN)]
        hits = [hit for hit in cast(rays, place, ways) if hit is not None]
        if len(hits) < len(ways):
            continue  # it looks out of a window or a hole
        nearest, middle = np.percentile([(at - place).length for at, _, _ in hits], (5, 50))
        worth = middle * len({item for _, _, item in hits})**0.5  # a long view of things, not of a wall
        if nearest > NEAR * middle and worth > most:
            matrix = turn.to_4x4()
            matrix.translation = place
            best, most = View(matrix, HALF_WIDTH, float(middle), (0.0, MOST_REACH), True), float(worth)
    return best
