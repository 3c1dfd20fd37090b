"""Add, fit and remove the camera array of a scene; in a closed room it stands where it sees most."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Collection, Iterable

import bpy
import mathutils
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..contents import find_subject, with_copied
from . import placement, rig
from .placement import Rays, Thing, View, as_rendered, through
from .rig import Placement, from_blender, to_blender, upright

ARRAY_NAME, PLANE_NAME = "Light Field Array", "Display Plane"
HANDLE_SIZE = 0.05  # as a fraction of the distance to the display plane
FAR = 1e4  # clip end of an array that stands at no camera, as a multiple of that distance
SPACING_HELP = "Spacing of the cameras as a fraction of the spacing that fills the display's viewing angle"
PLANE_HELP = "Marks the display plane of a light-field camera array"


@as_rendered()
def add(scene: bpy.types.Scene, profile: DisplayProfile) -> bpy.types.Object:
    """Add a camera array at the scene's camera if that sees the subject, else before the subject, else the origin.

    At a camera that is animated it moves along.
    """
    if rig.find(scene) is not None:
        raise LfsrError(f"scene {scene.name!r} has a camera array already: fit it, or remove it first")
    camera, placed, leading = scene.camera, None, None
    try:  # before it exists: it would be taken for the scene's own
        subject = find_subject(scene)
    except LfsrError:  # a display about one unit wide
        placed = placement.fit_array(np.array([-0.4, -0.1, -0.2]), np.array([0.4, 0.1, 0.2]), profile)
    else:
        if camera is not None and camera.type == "CAMERA":
            with contextlib.suppress(LfsrError):  # it is no perspective camera, or the subject is out of its sight
                placed, leading = placement.array_of_camera(scene, profile, subject), camera
        placed = placed or in_front(scene, profile, subject)
    return _following(put(scene, profile, placed), leading)


@as_rendered()
def fit(scene: bpy.types.Scene, profile: DisplayProfile, items: Collection[bpy.types.Object]) -> bpy.types.Object:
    """Move the scene's array in front of ``items``, in its present direction; add one if there is none."""
    array, turn = rig.find(scene), mathutils.Matrix.Identity(3)
    if array is not None:  # rotation from a new array, which looks along +Y with Z up
        turn = upright(array).to_3x3() @ mathutils.Matrix.Rotation(-math.pi / 2, 3, "X")
    if not (points := list(placement.world_points(set(items)))):
        raise LfsrError("nothing with geometry is selected: select the objects that the display should show")
    placed = fit_turned(np.concatenate(points), profile, turn)
    return put(scene, profile, (placement.narrowed(Rays(scene), placed, profile, placed[0].distance), placed[1]))


@as_rendered()
def fit_to_camera(scene: bpy.types.Scene, profile: DisplayProfile) -> bpy.types.Object:
    """Move the scene's array to its active camera; add one if there is none."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        raise LfsrError(f"scene {scene.name!r} has no active camera: add one, or fit to the view")
    if rig.is_array(camera):
        raise LfsrError(f"the active camera {camera.name!r} is the camera array itself: make another camera active, or "
                        "fit to the view")
    return _following(put(scene, profile, placement.array_of_camera(scene, profile, find_subject(scene))), camera)


@as_rendered()
def fit_to_view(scene: bpy.types.Scene, profile: DisplayProfile, view: View) -> bpy.types.Object:
    """Move the scene's array so that the display shows what a 3D view shows; add one if there is none."""
    if view.is_perspective:
        subject = set[bpy.types.Object]()
        with contextlib.suppress(LfsrError):
            subject = find_subject(scene)
        placed = placement.array_of_view(scene, profile, subject, view)
    else:
        # A parallel view has no eye: the display stands at its centre, and viewers at their distance from it.
        array = CameraArray.for_display(profile, 2 * view.half_width)
        moved = mathutils.Matrix.Translation((0, 0, array.distance))
        placed = array, from_blender(mathutils.Matrix(view.matrix) @ moved)
    return put(scene, profile, placed)


def remove(scene: bpy.types.Scene) -> None:
    """Remove the scene's camera array, from the file unless another scene shows it, and planes without an array."""
    if (array := rig.find(scene)) is None:
        raise LfsrError(f"scene {scene.name!r} has no camera array to remove")
    rig.check_editable(array)
    camera = array.data
    for item in filter(None, (rig.plane_of(array), array)):
        is_shared = len(item.users_scene) > 1 and scene.collection in item.users_collection
        scene.collection.objects.unlink(item) if is_shared else bpy.data.objects.remove(item)
    scene.camera = None if rig.is_array(scene.camera) else scene.camera
    if camera.users == 0:
        bpy.data.cameras.remove(camera)
    remove_planes(scene)


def remove_planes(scene: bpy.types.Scene) -> None:
    """Remove display planes whose array was deleted by hand."""
    for plane in [item for item in scene.objects if rig.PLANE in item and not rig.is_array(item.parent)]:
        bpy.data.objects.remove(plane)


def put(scene: bpy.types.Scene, profile: DisplayProfile, placed: Placement) -> bpy.types.Object:
    """Return the array of the scene, added if there is none, at a placement, where it follows no camera."""
    rig.check_editable(scene)
    array = rig.find(scene) or _new_array(scene)
    rig.check_editable(array)
    layout, matrix = placed
    array[rig.SPACING] = rig.part_of_spacing(layout, profile)
    if array.parent is not None and array.parent.type == "CAMERA":
        array.parent = None
    array.data.driver_remove("lens")
    if (plane := rig.plane_of(array)) is None:
        plane = bpy.data.objects.new(PLANE_NAME, None)
        plane.empty_display_type, plane[rig.PLANE] = "SINGLE_ARROW", True
        plane.id_properties_ui(rig.PLANE).update(description=PLANE_HELP)
        for collection in array.users_collection:
            collection.objects.link(plane)
        plane.parent = array
        # It only slides along the view.
        plane.lock_location = (True, True, False)
        plane.lock_rotation = plane.lock_scale = (True, True, True)
    array.matrix_world = to_blender(matrix)
    array.data.lens = array.data.sensor_width / 2 * layout.distance / layout.half_width
    array.data.clip_start, array.data.clip_end = layout.clip or (layout.distance / 1000, layout.distance * FAR)
    array.data.display_size = layout.half_width * 0.25
    plane.location, plane.empty_display_size = (0.0, 0.0, -layout.distance), layout.distance * HANDLE_SIZE
    bpy.context.view_layer.update()
    return array


def _following(array: bpy.types.Object, camera: bpy.types.Object | None) -> bpy.types.Object:
    """Return ``array``, as a child of ``camera`` if that moves, with a lens that follows if that zooms."""
    if camera is not None and placement.moves(camera):
        array.parent, array.matrix_parent_inverse = camera, camera.matrix_world.inverted_safe()
    # Linked data cannot depend on this file's.
    if camera and camera.data.type == "PERSP" and camera.data.animation_data and not array.data.library:
        driver = array.data.driver_add("lens").driver
        target, driver.expression = driver.variables.new().targets[0], f"var * {array.data.lens / camera.data.lens}"
        target.id_type, target.id, target.data_path = "CAMERA", camera.data, "lens"
    bpy.context.view_layer.update()
    return array


def _new_array(scene: bpy.types.Scene) -> bpy.types.Object:
    """Array of the scene, which becomes the active camera if there is none."""
    remove_planes(scene)
    data = bpy.data.cameras.new(ARRAY_NAME)
    data.sensor_fit, data.show_passepartout = "HORIZONTAL", False  # its frame is the scene's, not the display's
    array = bpy.data.objects.new(ARRAY_NAME, data)
    array[rig.SPACING] = 1.0
    array.property_overridable_library_set(f'["{rig.SPACING}"]', True)
    array.id_properties_ui(rig.SPACING).update(min=0.01, soft_max=1.0, default=1.0, description=SPACING_HELP)
    # The scene's own collection cannot be excluded or hidden.
    scene.collection.objects.link(array)
    if scene.camera is None:
        scene.camera = array
    return array


APART, ENCLOSING = 4.0, 20.0  # times the size of all others, from which an object lies far away, or is a dome
FREE, FLOOR = 1.0, 0.02  # of a stage: walls FREE times that size away; the rest stands within FLOOR of its floor
FLAT, WIDE = 0.05, 4.0  # of a floor: thickness to length; area to what is on it, of a road the length to its width
# A ground with a pond or hills: thickness to the height of what is on it, to the size of MANY things; area as before.
HILLY, WIDER, MANY, WIDER_OF_MANY = 0.5, 10.0, 10, 8.0
MOST_SURROUNDINGS = 6
# Fractions of the picture below which a subject is narrow, or may have thin tails; where these begin, as in a box plot;
# size of the whole to that of the rest, from which they are tails and no blade.
NARROW, LEAST_SEEN, WHISKERS, TAILS = 0.1, 0.015, 1.5, 3.0
TRAVELS = 2.0  # times its size in this frame, over which it moves in an animation
# Weights of views by degrees around Z from the front. Weights by degrees from above: for a subject as high as wide, and
# for one of at most LOW times that height, because a landscape or a plate is best seen from above.
TURNS = {0: 1.0, 30: 0.9, -30: 0.9, 90: 0.75, -90: 0.7, 180: 0.7}  # +X is the front in some programs
TILTS, LOW = {0: (1.0, 1.0), 35: (0.7, 1.0), 65: (0.15, 0.5)}, 0.6
# Fraction of hits on fronts below which a view counts less; its weight without any, and that for a low subject.
FRONTS, FROM_BEHIND, LOW_FROM_BEHIND = 0.5, 0.25, 0.9
ROOMY, END_ON = 0.5, 0.4  # parts of the display's spacing that a place should leave, of a length that should be seen
SOLID, PLAIN, ONE_SIDE = 0.3, 0.02, 0.7  # least thickness to length of a box, most variety of its side, and its weight
# Objects fitted by their vertices, about how many of each; part of the whole below which as many copies count as boxes.
FEW_OBJECTS, MOST_POINTS, SMALL = 100, 20_000, 0.02
PROBED, FEWER = (24, 14), (16, 9)  # rays that judge a view, across and down


@as_rendered()
def in_front(scene: bpy.types.Scene, profile: DisplayProfile, subject: set[bpy.types.Object]) -> Placement:
    """Return an array before the subject without its floors, from where it shows most; LfsrError if it has no size.

    It looks along +Y with Z up, unless much more is seen from a side or from above, or from inside a closed room.
    """
    corners, present = dict[bpy.types.Object, list[Array]](), boxes_now(subject)
    for _ in placement.sample_frames(scene):
        for owner, box in boxes_now(subject).items():
            corners.setdefault(owner, []).append(box)
    moved = {owner: np.concatenate(parts) for owner, parts in corners.items()}
    for boxes in (moved, present):  # it stays in sight over an animation, unless it travels far
        chosen = main_part(boxes)
        points, now = (np.concatenate([group[item] for item in chosen if item in group] or [np.empty((0, 3))])
                       for group in (boxes, present))
        if not len(now) or np.linalg.norm(np.ptp(points, axis=0)) <= TRAVELS * np.linalg.norm(np.ptp(now, axis=0)):
            break
    if not len(points):
        raise LfsrError("the subject has no visible geometry: make its objects visible or choose another subject")
    rays, shown = Rays(scene), with_copied(set(chosen))
    is_still = all(item in present and len({box.tobytes() for box in corners[item]}) == 1 for item in chosen)
    low, high = points.min(0), points.max(0)
    # From the middle of its way: a view is judged as if the subject stood there, since it is large where it is near.
    away = (now.min(0) + now.max(0) - low - high) / 2 if len(now) else 0 * low
    most, view = 0, view_inside(rays, low, high)
    if len(chosen) <= FEW_OBJECTS:  # the boxes of others are small enough
        frames = (scene.frame_current,) if is_still or boxes is present else placement.sample_frames(scene)
        copies = len(now) / 8 / FEW_OBJECTS
        small = SMALL * copies * math.dist(low, high) if copies > 1 else 0.0
        points = np.concatenate([cloud[::len(cloud) // MOST_POINTS + 1] for _ in frames
                                 for cloud in placement.world_points(set(chosen), small)] or [points])
    upper = points[points[:, 2] > low[2] + FLAT * (high - low)[2]]  # without the ground that a mesh may hold
    if len(upper) and np.ptp(points, axis=0)[:2].prod() > WIDER * np.ptp(upper, axis=0)[:2].prod():
        low, high = np.append(upper.min(0)[:2], low[2]), upper.max(0)
        points = np.clip(points, low, high)
    probes = FEWER if rays.items else PROBED  # in a scene of many objects a ray takes long
    lower, upper = np.percentile(points, (25, 75), axis=0)
    without_tails = np.clip(points, lower - WHISKERS * (upper - lower), upper + WHISKERS * (upper - lower))
    has_tails = np.ptp(points, axis=0).max() > TAILS * np.ptp(without_tails, axis=0).max()
    # Too few rays meet a narrow subject, such as a standing figure, unless all are sent towards it.
    for fitted, all_meet, least in ((points, False, NARROW), (points, True, LEAST_SEEN if has_tails else 0),
                                    (without_tails, False, 0)):
        choices, size = list[tuple[float, float, Placement]](), np.ptp(fitted, axis=0)
        for (tilt, above), (degrees, wide) in itertools.product(TILTS.items(), TURNS.items()):
            turn = (mathutils.Matrix.Rotation(math.radians(degrees), 3, "Z")
                    @ mathutils.Matrix.Rotation(math.radians(-tilt), 3, "X"))
            array, matrix = placed = fit_turned(fitted, profile, turn)
            part, place = np.ones(2), mathutils.Matrix(matrix)
            if all_meet:
                local = (fitted - place.translation) @ np.array(place.to_3x3())
                part = np.minimum(np.abs(local[:, :2] / local[:, 2:]).max(0) * array.distance / array.half_size, 1)
            hits = [hit for hit in through(rays, placed, *probes, part) if hit is not None]
            most, seen = max(most, len({hit[3] for hit in hits})), [hit for hit in hits if hit[2] in shown]
            # Surfaces that face several ways show a shape. For a plane, such as the side of a box, this is 0.
            various = 1 - np.linalg.norm(np.mean([hit[4] for hit in seen] or [(0, 0, 1)], axis=0))
            shape = ONE_SIDE if various < PLAIN and size.min() > SOLID * size.max() else 1 + various
            counts = np.interp(size[2] / max(1e-9, size[:2].min()), (LOW, 1), above[::-1]) * wide * shape
            share = len(seen) / math.prod(probes) * part.prod()
            # Part of the hits that are of fronts, or of solid things whose normals point inwards.
            ahead = np.mean([hit[1] or ((beyond := rays.beyond(hit[0], way := hit[0] - place.translation)) is not None
                                        and beyond[2] == hit[2] and beyond[1].dot(way) < 0)
                             for hit in seen] or [False])
            behind = FROM_BEHIND if size[2] > LOW * size[:2].min() else LOW_FROM_BEHIND
            counts *= np.interp(ahead, (0, FRONTS), (behind, 1)) * (1 + turn.col[1].dot(away) / array.distance)**2
            extent = np.ptp(np.percentile([hit[0] for hit in seen] or [(0, 0, 0)], (5, 95), axis=0), axis=0).max()
            room = placement.narrowed(rays, placed, profile, array.distance)  # no views below a ground, or of one end
            counts *= min(extent / (END_ON * size.max()), 1) * min(rig.part_of_spacing(room, profile) / ROOMY, 1)
            choices.append((counts * share * len({hit[3] for hit in seen}), share, placed))
        enough = [choice for choice in choices if all_meet and choice[1] > least] or choices
        _, share, best = max(enough, key=lambda choice: choice[0])
        if share > least:
            break
    if view is not None:
        inside = placement.array_of_view(scene, profile, subject, view)
        inner = [hit for hit in through(rays, inside, *probes) if hit is not None]
        fronts, things = [hit[0] for hit in inner if hit[1]], len({hit[3] for hit in inner})
        # Backs of surfaces are the inside of a solid thing. What is closed shows its shell alone from outside.
        is_closed = is_inside(rays, view.matrix.translation)
        if things > 1 and fronts and things * len(fronts) >= ROOM[is_closed] * most * len(inner):
            into = []  # choices that see enough of these fronts
            for choice in choices:
                eye = mathutils.Matrix(choice[2][1]).translation
                met = ((rays.cast(eye, place - eye), place, place - eye) for place in fronts)
                if sum(hit is not None and (hit[0] - place).length < 1e-3 * way.length and hit[1].dot(way) < 0
                       for hit, place, way in met) >= OPEN * len(fronts):
                    into.append(choice)
            if not into or is_closed:
                return inside
            if 3 * len(into) <= len(choices):
                _, _, best = max(into, key=lambda choice: choice[0])  # where a wall is missing
    array = best[0]
    if len(depths := placement.seen_depths(scene, best, shown, rays)) and is_still:
        # In the middle of what is seen, not of the box: nobody sees what lies behind it.
        distance = placement.middle(depths)
        array = CameraArray.for_display(profile, 2 * array.half_width / array.distance * distance, distance)
    return placement.narrowed(rays, (array, best[1]), profile, array.distance), best[1]


def fit_turned(points: Array, profile: DisplayProfile, turn: mathutils.Matrix) -> Placement:
    """Return ``fit_array`` for world points (n, 3), turned by a rotation (3, 3)."""
    turned = np.array(turn).T @ points.T  # (3, n): extremes of contiguous rows are fast
    layout, matrix = placement.fit_array(turned.min(1), turned.max(1), profile)
    return layout, tuple(tuple(row) for row in turn.to_4x4() @ mathutils.Matrix(matrix))


def main_part(corners: dict[bpy.types.Object, Array]) -> list[bpy.types.Object]:
    """Return the objects, of which world corners (n, 3) are given, without floors, backdrops and what lies far away."""
    items, boxes = list(corners), bounds(corners.values())
    while left_out := _surroundings(boxes) or _far_away(boxes):
        kept = [index for index in range(len(items)) if index not in left_out]
        items, boxes = [items[index] for index in kept], boxes[kept]
    return items


def _far_away(boxes: Array) -> list[int]:
    """Index of the box without which the bounding box of all is APART times smaller; empty if there is none."""
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
    """Numbers of the few boxes that are floors, backdrops or domes, far larger than all others together, near them."""
    largest = [int(index) for index in np.argsort(-_diagonal(boxes[:, 0], boxes[:, 1]))[:MOST_SURROUNDINGS]]
    for count in range(min(MOST_SURROUNDINGS, len(boxes) - 1), 0, -1):
        rest, around = np.delete(boxes, largest[:count], axis=0), boxes[largest[:count]]
        low, high = rest[:, 0].min(0), rest[:, 1].max(0)
        sides, size, inner = around[:, 1] - around[:, 0], _diagonal(around[:, 0], around[:, 1]), _diagonal(low, high)
        is_thin = sides == sides.min(1, keepdims=True)
        area, covered = (np.where(is_thin, 1, lengths).prod(1) for lengths in (sides, high - low))
        scale, wider = (inner, WIDER_OF_MANY) if len(rest) >= MANY else ((high - low)[2], WIDER)
        # A room is looked at from inside. A gear is no floor of its shaft, which reaches as far down as up.
        bottom, shift = around[:, 0, 2], np.abs(around[..., 2].mean(1) - (low + high)[2] / 2)
        is_part = is_thin[:, 2] & ((bottom >= high[2]) | (low[2] < bottom) & (shift < FLAT * (high - low)[2]))
        is_floor = ~is_part & ((sides.min(1) < FLAT * sides.max(1)) & (area > WIDE * covered)
                               | is_thin[:, 2] & (sides[:, 2] < HILLY * scale) & (area > wider * covered))
        grounds = around[is_floor & is_thin[:, 2], 0, 2]  # a road on one belongs to it, if it is longer than all others
        is_road = is_thin[:, 2] & (sides[:, 2] < FLAT * size) & (np.sort(sides)[:, 1] < size / WIDE)
        is_floor |= is_road & (size > inner) & (np.abs(around[:, :1, 2] - grounds) < FLOOR * size[:, None]).any(1)
        gaps = np.maximum(np.maximum(around[:, 0] - high, low - around[:, 1]), 0)
        free = np.minimum(low - around[:, 0], around[:, 1] - high)
        is_dome = ~is_floor & (size > ENCLOSING * inner)  # one at most, else a small thing would seem to be all
        is_stage = ~is_dome & (free[:, :2].min(1) > FREE * inner) & (around[:, 1, 2] > high[2]) & (
            np.abs(low - around[:, 0])[:, 2] < FLOOR * sides[:, 2])
        near = np.where(is_floor | is_stage, size, inner)
        is_around = is_floor | is_stage | is_dome & (is_dome.sum() < 2)
        if (is_around & (np.linalg.norm(gaps, axis=-1) < near)).all():
            return largest[:count]
    return []


def _diagonal(low: Array, high: Array) -> Array:
    return np.asarray(np.linalg.norm(high - low, axis=-1))


def bounds(corners: Collection[Array]) -> Array:
    """Return the lowest and the highest coordinates (n, 2, 3) of each of n sets of points (m, 3)."""
    if not corners:
        return np.empty((0, 2, 3))
    points, starts = np.concatenate([*corners]), np.cumsum([0, *map(len, corners)])[:-1]
    return np.stack([extreme.reduceat(points, starts) for extreme in (np.minimum, np.maximum)], 1)


def boxes_now(subject: set[bpy.types.Object]) -> dict[bpy.types.Object, Array]:
    """Return world corners (n, 3) of the bounding boxes of what each object of the subject shows in this frame."""
    corners: dict[bpy.types.Object, list[Array]] = {}
    owners, boxes = placement.boxes(subject)
    for owner, box, has_size in zip(owners, boxes, np.ptp(boxes, axis=1).any(-1), strict=True):
        if has_size:
            corners.setdefault(owner, []).append(box)
    return {owner: np.concatenate(parts) for owner, parts in corners.items()}


# Places across a room's bounding box, and among many objects, where a ray takes long; at half of its height, away from
# its sides.
GRID, FEWER_PLACES, HEIGHT, MARGIN = 5, 3, 0.5, 0.15
EYE_HEIGHT = 1.6  # metres above the floor, of more places where the middle is higher, as in a hall or under a sky
# Views at each place are parts of one panorama: degrees between its rays, and from its highest to its lowest; rays of a
# view down and across; half its width at distance 1, of about 62°.
STEP, HIGHEST, LOWEST, VIEW_RAYS, HALF_WIDTH = 7.5, 30.0, -60.0, (5, 8), 0.6
LEAST_ROOM = 1.5  # metres: nobody stands in what is narrower, a cupboard or the hull of a small thing
AROUND_AXIS, ROUND = 24, 0.97  # rays to the axis of what is round, and their least cosine to its walls
ENCLOSED, SURROUNDED = 0.9, 0.7  # least fraction of rays that hit: in a closed place, in a room that lacks walls
# Fewest things in a view inside a room that is open, or closed, as a fraction of the most in a view from outside;
# fraction of their places that a view from outside sees where a wall is missing.
ROOM, OPEN = (0.85, 1.1), 0.5
LEAST_DEPTH, NEAR = 0.1, 0.15  # of a view inside a room: part of its diagonal; of that depth, where nothing may stand
AROUND = [mathutils.Vector(way).normalized() for way in itertools.product((-1, 0, 1), repeat=3) if any(way)]


def around(rays: Rays, hits: Iterable[placement.Seen]) -> Array:
    """Return how far rays go from what was seen to all sides before they meet something; infinite where nothing is."""
    return np.array([math.inf if (far := rays.beyond(hit[0], way)) is None else (far[0] - hit[0]).length
                     for hit in hits for way in AROUND if way.dot(hit[4]) > 0])


def is_inside(rays: Rays, place: mathutils.Vector, least: float = ENCLOSED) -> bool:
    """Return True if at least a fraction ``least`` of the rays around ``place`` meet something."""
    return sum(rays.cast(place, way) is not None for way in AROUND) >= least * len(AROUND)


def view_inside(rays: Rays, low: Array, high: Array) -> View | None:
    """Return the view of most things from a place in a box of world corners (3,) that is closed on most sides, if any.

    In what is smaller than a cupboard, or round, as a globe, a dome or a bottle, there is none.
    """
    size, reach, metre = high - low, float(np.linalg.norm(high - low)), 1 / rays.scene.unit_settings.scale_length
    centre, turns = mathutils.Vector((low + high) / 2), np.linspace(0, math.tau, AROUND_AXIS)
    ways = [mathutils.Vector((math.cos(turn), math.sin(turn), 0)) for turn in turns]
    outer = [rays.cast(centre - way * reach, way) for way in ways]
    is_round = sum(hit is not None and abs(hit[1].xy.normalized().dot(way.xy)) > ROUND
                   for hit, way in zip(outer, ways, strict=True)) > ENCLOSED * AROUND_AXIS
    if is_round or size.min() < LEAST_ROOM * metre:
        return None
    places, below = list[mathutils.Vector](), mathutils.Vector((0, 0, -1))
    for x, y in itertools.product(np.linspace(MARGIN, 1 - MARGIN, FEWER_PLACES if rays.items else GRID), repeat=2):
        places.append(mathutils.Vector(low + size * (x, y, HEIGHT)))
        floor = rays.cast(places[-1], below)
        if floor is not None and places[-1].z - floor[0].z > EYE_HEIGHT * metre:
            places.append(floor[0] - EYE_HEIGHT * metre * below)
    places = [place for place in places if is_inside(rays, place, SURROUNDED)]
    best, most = None, 0.0
    pitches, yaws = np.radians(np.arange(HIGHEST, LOWEST - 1, -STEP)), np.radians(np.arange(0, 360, STEP))
    ways = [mathutils.Euler((math.pi / 2 + pitch, 0, yaw)).to_matrix() @ mathutils.Vector((0, 0, -1))
            for pitch in pitches for yaw in yaws]
    panorama = np.pad(np.arange(len(ways)).reshape(len(pitches), -1), ((0, 0), (0, VIEW_RAYS[1] - 1)), "wrap")
    # Numbers (views, rays) of the rays of each view; pitches and yaws (views,) of its middle.
    views = np.lib.stride_tricks.sliding_window_view(panorama, VIEW_RAYS).reshape(-1, math.prod(VIEW_RAYS))
    down, across = np.radians(STEP) * np.subtract(VIEW_RAYS, 1) / 2
    pitches, yaws = pitches[views[:, 0] // len(yaws)] - down, yaws[views[:, 0] % len(yaws)] + across
    for place in places:
        hits, numbers = [rays.cast(place, way) for way in ways], dict[Thing, int]()
        met = np.array([numbers.setdefault(rays.thing(hit), len(numbers)) if hit else -1 for hit in hits])
        seen = (met == np.arange(len(numbers))[:, None]).astype(float)
        fronts = np.array([hit is not None and hit[1].dot(way) < 0 for hit, way in zip(hits, ways, strict=True)])
        depths = np.sort(np.array([(hit[0] - place).length if hit else 0 for hit in hits])[views])  # 0: a hole
        nearest, middle = depths[:, views.shape[1] // 20], depths[:, views.shape[1] // 2]
        is_free = (depths[:, 0] > 0) & (nearest > NEAR * middle) & (middle >= LEAST_DEPTH * reach)
        # The best view is long, nearly level, and shows many things uncut, and fronts of surfaces.
        whole = (seen[:, views].sum(-1) / seen.sum(1)[:, None]).sum(0) * np.cos(2 * pitches)
        worth = is_free * fronts[views].mean(1) * np.sqrt(nearest * middle) * whole
        if worth.max() > most:
            at, most = worth.argmax(), worth.max()
            eye = mathutils.Matrix.LocRotScale(place, mathutils.Euler((math.pi / 2 + pitches[at], 0, yaws[at])), None)
            best = View(eye, HALF_WIDTH, float(middle[at]), None, True)
    return best
