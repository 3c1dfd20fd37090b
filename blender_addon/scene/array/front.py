"""Where an array stands that nobody has placed: at the scene's camera, or in front of what matters in the scene."""

from __future__ import annotations

import contextlib
import math

import bpy
import mathutils
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile

from ..subject import GEOMETRY, find_subject
from . import motion, placement
from .rig import Placement

APART, ENCLOSING = 4.0, 20.0  # times the size of all others, from which a flat object is a floor, and any other a dome
FLAT = 0.05  # thickness of a floor, as a fraction of its length
MOST_SURROUNDINGS = 3
TURNS = (0, 30, -30, 90, -90, 180)  # degrees around Z, from the front
SEEN = 0.1  # fraction of the rays through the display that must meet the subject


def first_placement(scene: bpy.types.Scene, profile: DisplayProfile) -> Placement:
    """Return the place of a new array: at the scene's camera if that sees the subject, else in front of the subject.

    In front of the origin where the scene shows nothing.
    """
    try:
        subject = find_subject(scene)
    except LfsrError:
        # A display about one unit wide.
        return placement.fit_array(np.array([-0.4, -0.1, -0.2]), np.array([0.4, 0.1, 0.2]), profile)
    if scene.camera is not None and scene.camera.type == "CAMERA":
        with contextlib.suppress(LfsrError):  # it is no perspective camera, or the subject is out of its sight
            return placement.array_of_camera(scene, profile, subject)
    return in_front(scene, profile, subject)


def in_front(scene: bpy.types.Scene, profile: DisplayProfile, subject: set[bpy.types.Object]) -> Placement:
    """Return an array in front of the subject without its floors, where nothing hides it; LfsrError if it has no size.

    It looks along +Y with Z up, or is turned around Z where something else stands before the subject.
    """
    boxes = _boxes(scene, subject)
    chosen = main_part(list(boxes), np.array([(box.min(0), box.max(0)) for box in boxes.values()]))
    points = np.concatenate([boxes[item] for item in chosen] or [np.empty((0, 3))])
    if not len(points):
        raise LfsrError("the subject has no visible geometry: make its objects visible or choose another subject")
    best, most = None, -1
    for degrees in TURNS:
        placed = fit_turned(points, profile, mathutils.Matrix.Rotation(math.radians(degrees), 3, "Z"))
        seen = len(placement.seen_depths(scene, placed, set(chosen)))
        if seen > most:
            best, most = placed, seen
        if seen >= SEEN * math.prod(placement.PROBES):
            break
    assert best is not None
    return best


def fit_turned(points: Array, profile: DisplayProfile, turn: mathutils.Matrix) -> Placement:
    """Return ``fit_array`` for world points (n, 3), turned by a rotation (3, 3)."""
    turned = points @ np.array(turn)
    layout, matrix = placement.fit_array(turned.min(0), turned.max(0), profile)
    world = turn.to_4x4() @ mathutils.Matrix(matrix)
    return layout, tuple(tuple(row) for row in world)


def main_part(items: list[bpy.types.Object], boxes: Array) -> list[bpy.types.Object]:
    """Return the objects without floors, backdrops and what lies far away.

    ``boxes`` (n, 2, 3): lowest and highest corner of each.
    """
    while left_out := _surroundings(boxes) or _far_away(boxes):
        kept = [index for index in range(len(items)) if index not in left_out]
        items, boxes = [items[index] for index in kept], boxes[kept]
    return items


def _far_away(boxes: Array) -> list[int]:
    """Number of the box without which that of the others is APART times smaller, none if there is none such."""
    if len(boxes) < 2:
        return []
    # Diagonal (n,) of the bounding box of all boxes but one.
    low, high = np.sort(boxes[:, 0], axis=0), np.sort(boxes[:, 1], axis=0)
    rest = _diagonal(np.where(boxes[:, 0] == low[0], low[1], low[0]),
                     np.where(boxes[:, 1] == high[-1], high[-2], high[-1]))
    whole = _diagonal(low[0], high[-1])
    # Of two that lie apart the smaller one goes.
    apart = np.where(rest >= _diagonal(boxes[:, 0], boxes[:, 1]), whole / np.maximum(rest, 1e-9 * whole or 1), 0)
    return [int(apart.argmax())] if apart.max() > APART else []


def _surroundings(boxes: Array) -> list[int]:
    """Numbers of the few boxes that are flat or far larger than all others together, and near them."""
    sizes = _diagonal(boxes[:, 0], boxes[:, 1])
    largest = [int(index) for index in np.argsort(-sizes)[:MOST_SURROUNDINGS]]
    for count in range(min(MOST_SURROUNDINGS, len(boxes) - 1), 0, -1):
        rest, around = np.delete(boxes, largest[:count], axis=0), boxes[largest[:count]]
        low, high = rest[:, 0].min(0), rest[:, 1].max(0)
        sides = around[:, 1] - around[:, 0]
        times = np.where(sides.min(1) < FLAT * sides.max(1), APART, ENCLOSING)
        gaps = np.maximum(np.maximum(around[:, 0] - high, low - around[:, 1]), 0)
        size = _diagonal(around[:, 0], around[:, 1])
        if ((size > times * _diagonal(low, high)) & (np.linalg.norm(gaps, axis=-1) < size)).all():
            return largest[:count]
    return []


def _diagonal(low: Array, high: Array) -> Array:
    size: Array = np.linalg.norm(high - low, axis=-1)
    return size


def _boxes(scene: bpy.types.Scene, subject: set[bpy.types.Object]) -> dict[bpy.types.Object, Array]:
    """World corners (n, 3) of the bounding boxes of what each object of the subject shows, over an animation."""
    corners: dict[bpy.types.Object, list[Array]] = {}
    for _ in motion.frames(scene):
        for item, owner, matrix in placement.instances(subject):
            if item.type in GEOMETRY and not owner.hide_render and any(item.dimensions):
                corners.setdefault(owner, []).append(np.array(item.bound_box) @ matrix[:3, :3].T + matrix[:3, 3])
    return {owner: np.concatenate(found) for owner, found in corners.items()}
