"""Where the camera array stands: at its place in the scene, at the scene's camera, or in front of the subject.

Rays tell what is seen from there, in sample frames of an animation.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from copy import copy
from typing import Any

import bpy
import mathutils
import numpy as np
from mathutils.bvhtree import BVHTree

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.frames.frame import FIT, Request, spread
from lfsr_core.optics.depth_scale import ScaleChoice, choose_scale, disparities
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray, Clip

from ...compat import overridden
from ..contents import GEOMETRY, curves, find_subject, rendered, rendered_layer
from ..contents import collections as layer_collections
from . import rig
from .rig import Placement, from_blender, upright

FILL = 0.85           # fraction of the display that the subject may fill, seen from the centre
LEAST_FILL = 0.5      # a deep subject is made smaller to fit the usable depth, but not below this
WALL_MARGIN = 0.9     # fraction of the free space around the camera that the array may use
MOST_NAMES = 3
NEEDLE, MOST_TRIANGLES = 1e-5, 200_000  # height by length of one without an area; number from which all points count
PROBES = (32, 18)     # rays across and down that measure the visible depth of the subject
BOXED = {"VOLUME", "CURVES", "POINTCLOUD"}  # known by their bounding boxes only
MOST_FRAMES, CAMERA_FRAMES = 24, 5  # sampled from an animation, and for the array at a camera, whose place is known
PARALLEL, COVERED = 150.0, 0.9  # frame sizes from which rays seem parallel; fraction of its width that a backdrop has
ROOM, TINY = 1 + 1e-6, 1e-30  # factor of spheres, against rounding errors; replaces 0 in directions of rays
FEW = 100  # objects and instances up to which Blender's own search, which asks each of them, is the fastest
MOST_REACH = 1e30  # far enough; for Blender's longest rays it reports hits of scaled objects that they miss

Hit = tuple[mathutils.Vector, mathutils.Vector, bpy.types.Object, int]  # place, normal of the surface, object, face
Thing = tuple[bpy.types.Object, bpy.types.Material | None]  # object and its material (``Rays.thing``)
# Place, whether the front of a surface is seen, of what, and the surface's normal toward where the ray comes from.
Seen = tuple[mathutils.Vector, bool, bpy.types.Object, Thing, mathutils.Vector]


@contextmanager
def as_rendered(*left_out: bpy.types.Object | None, by: str = "visible_camera") -> Iterator[None]:
    """Show in the viewport what cameras see in renders, or shadow rays meet, but for ``left_out``, inside the block."""
    with ExitStack() as changes:
        # Renders show the first view layer that is used, whichever the window shows.
        changes.enter_context(bpy.context.temp_override(view_layer=rendered_layer(bpy.context.scene)))
        bpy.context.view_layer.update()  # else it lists objects that a batch removal has freed, and Blender crashes
        for item in [selected for selected in bpy.context.view_layer.objects if selected.select_get()]:
            changes.callback(item.select_set, True)  # last of all, because Blender deselects what is hidden
        for item in filter(None, left_out):
            changes.enter_context(overridden(item, {"hide_render": True}))
        seen = {item for item in rendered(bpy.context.scene) if getattr(item, by)}
        for layer in layer_collections(bpy.context.view_layer.layer_collection):
            for owner, is_hidden in ((layer, False), (layer.collection, layer.collection.hide_render)):
                if owner.hide_viewport != is_hidden:
                    changes.enter_context(overridden(owner, {"hide_viewport": is_hidden}))
        for item in bpy.context.view_layer.objects:
            if item.type in GEOMETRY and item.visible_get() == (is_hidden := item not in seen):
                # What is off only with its collection may be copied by particles and geometry nodes.
                changes.enter_context(overridden(item, {"hide_viewport": item.hide_render or not getattr(item, by)}))
                changes.callback(item.hide_set, item.hide_get())
                item.hide_set(is_hidden)
        bpy.context.view_layer.update()
        yield
    bpy.context.view_layer.update()


# What cameras see over an animation (``array_of_camera``), where nobody edits the scene; None: looked for each time.
fields: dict[tuple[Any, ...], tuple[float, Array, float]] | None = None


class Rays:
    """The scene as the viewport shows it now (``as_rendered``): an edit calls for new ones."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        """Note the bounding boxes of all meshes where there are more than FEW objects."""
        self.scene, self.depsgraph = scene, bpy.context.evaluated_depsgraph_get()
        self.cast_in_all, self.materials = scene.ray_cast, dict[bpy.types.Object, Any]()  # to look up takes long
        self.items: list[tuple[bpy.types.Object, Array, BVHTree | None]] = []
        if len(self.depsgraph.object_instances) <= FEW:
            return
        import bmesh  # can be imported only after bpy
        boxes, shapes, trees = [], dict[int, list[tuple[float, ...]]](), dict[int, BVHTree | None]()
        for item, _, place in instances(set(bpy.data.objects)):
            if item.type == "MESH":
                key = item.data.as_pointer()  # which an object has alone where modifiers change it
                if key not in shapes:
                    shapes[key], trees[key] = [tuple(corner) for corner in item.bound_box], None
                    if item.original.evaluated_get(self.depsgraph).data != item.data:  # made by geometry nodes
                        shape = bmesh.new()
                        shape.from_mesh(item.data)
                        trees[key] = BVHTree.FromBMesh(shape)
                        shape.free()
                boxes.append(shapes[key])
                self.items.append((item.original, place, trees[key]))
        if self.items:
            matrices = np.array([matrix for _, matrix, _ in self.items])
            points = np.einsum("nij,nkj->ink", matrices[:, :3, :3], np.array(boxes)) + matrices[:, :3, 3].T[..., None]
            self.low, self.high = points.min(-1), points.max(-1)
            self.middles = (self.low + self.high) / 2
            self.squared_radii = ((self.high - self.low)**2).sum(0) * ROOM**2 / 4
            self.seen_from: tuple[float, ...] = ()
            self.met = dict[int, tuple[Any, ...]]()

    def cast(self, start: mathutils.Vector, way: mathutils.Vector, reach: float = MOST_REACH) -> Hit | None:
        """Return what a ray meets first within ``reach``; hair and volumes let it pass."""
        if not self.items:
            is_hit, place, normal, face, item, _ = self.cast_in_all(self.depsgraph, start, way, distance=reach)
            return (place, normal, item.original, face) if is_hit else None
        way = way.normalized()
        # First the spheres around all boxes, then the few boxes that are left.
        place, slopes = np.array(start)[:, None], np.array([[part or TINY] for part in way])
        if self.seen_from != (eye := tuple(start)):  # most rays start where the last one did
            self.seen_from, self.apart = eye, self.middles - place
            self.least = np.einsum("ij,ij->j", self.apart, self.apart) - self.squared_radii
        near = np.flatnonzero((np.array(way) @ self.apart)**2 >= self.least)
        first, second = (self.low[:, near] - place) / slopes, (self.high[:, near] - place) / slopes
        enters, leaves = np.minimum(first, second).max(0), np.maximum(first, second).min(0)
        met = np.flatnonzero((leaves >= np.maximum(enters, 0)) & (enters <= reach))
        best, nearest = None, reach
        for index in met[np.argsort(enters[met])]:
            if enters[index] > nearest:
                break
            with suppress(RuntimeError, ValueError):  # it has no mesh of its own, or no size
                if (number := near[index]) not in self.met:
                    item, world, tree = self.items[number]
                    inverse = (matrix := mathutils.Matrix(world)).inverted()
                    # An object tells first whether it is hit.
                    meet, told = ((tree.ray_cast, slice(0, 3)) if tree is not None
                                  else (item.evaluated_get(self.depsgraph).ray_cast, slice(1, 4)))
                    self.met[number] = item, matrix, inverse, inverse.to_3x3(), meet, told
                item, matrix, inverse, turn, meet, told = self.met[number]
                at, normal, face = meet(inverse @ start, turn @ way)[told]
                is_hit, at = face is not None and face >= 0, matrix @ (at or start)
                if is_hit and (at - start).length <= nearest:
                    nearest = (at - start).length
                    best = at, (turn.transposed() @ normal).normalized(), item, face
        return best

    def beyond(self, place: mathutils.Vector, way: mathutils.Vector) -> Hit | None:
        """Return what a ray that has met ``place`` meets next; it goes on by as little as floats allow."""
        hit = self.cast(place + max(1e-4, 2e-7 * place.length / way.length) * way, way)
        return None if hit is not None and hit[0] == place else hit

    def thing(self, hit: Hit) -> Thing:
        """Return the object that is hit and its material there: one mesh may hold a whole house."""
        if (stored := self.materials.get(hit[2])) is None:
            item = hit[2].evaluated_get(self.depsgraph)
            index = item.data.attributes.get("material_index") if isinstance(item.data, bpy.types.Mesh) else None
            numbers = np.zeros(len(index.data) if index else 0, np.int32)  # without an index all are 0
            if index:
                index.data.foreach_get("value", numbers)
            slots = [slot.material and slot.material.original for slot in item.material_slots]
            self.materials[hit[2]] = stored = numbers, slots or [None]
        numbers, slots = stored
        return hit[2], slots[min(numbers[hit[3]], len(slots) - 1) if 0 <= hit[3] < len(numbers) else 0]


@dataclasses.dataclass(frozen=True)
class View:
    """A 3D view, and the largest frame of the display's aspect in its middle."""

    matrix: mathutils.Matrix  # to the world, looking along -Z: of its eye, in a parallel view of the point it orbits
    half_width: float  # of the frame: at depth 1 in perspective, else everywhere
    pivot: float  # depth of the point that the view turns around, in perspective
    clip: Clip | None
    is_perspective: bool


def place_array(scene: bpy.types.Scene, profile: DisplayProfile, subject: set[bpy.types.Object]) -> Placement:
    """Return the scene's own array for ``profile``, else one at its camera, else one fitted to the subject."""
    if (own := rig.placement(scene, profile)) is not None:
        return own
    if scene.camera is not None and scene.camera.type == "CAMERA":
        return array_of_camera(scene, profile, subject)
    # Over the whole animation, so that every frame is seen from the same place.
    corners = [corner for _ in sample_frames(scene) for corner in bounds(subject)]
    return fit_array(np.min(corners, axis=0), np.max(corners, axis=0), profile)


def through(rays: Rays, placed: Placement, across: int = PROBES[0], down: int = PROBES[1],
            part: Sequence[float] | Array = (1.0, 1.0), eye: Sequence[float] | Array = (0.0, 0.0)) -> list[Seen | None]:
    """Return what rays from ``eye`` on the camera plane of an array, over this ``part`` of its display, meet first."""
    array, matrix = placed[0], mathutils.Matrix(placed[1])
    turn, rows = matrix.to_3x3(), (np.linspace(-part[1], part[1], down) * array.half_height - eye[1]).tolist()
    ways = [turn @ mathutils.Vector((x, y, array.distance))
            for x in (np.linspace(-part[0], part[0], across) * array.half_width - eye[0]).tolist() for y in rows]
    (start, end), place = array.clip or (0.0, MOST_REACH), matrix @ mathutils.Vector((*eye, 0))
    hits = (rays.cast(place + start / array.distance * way, way,
                      min((end - start) / array.distance * way.length, MOST_REACH)) for way in ways)
    return [(hit[0], cosine < 0, hit[2], rays.thing(hit), -hit[1] if cosine > 0 else hit[1]) if hit else None
            for hit, cosine in ((hit, hit[1].dot(way) if hit else 0.0) for hit, way in zip(hits, ways, strict=True))]


def seen_depths(scene: bpy.types.Scene, placed: Placement, subject: set[bpy.types.Object],
                rays: Rays | None = None) -> Array:
    """Return depths (n,) from the camera plane at which the middle of a ``placed`` array sees the subject."""
    toward = mathutils.Matrix(placed[1]).inverted()
    return np.array([(toward @ hit[0]).z for hit in through(rays or Rays(scene), placed) if hit and hit[2] in subject])


def unseen_notice(scene: bpy.types.Scene, profile: DisplayProfile, placed: Placement,
                  subject: set[bpy.types.Object]) -> Notice | None:
    """Return the notice that a ``placed`` array of ``profile`` sees other things than the subject, and where that lies.

    None if some of its views see the subject, or if rays could not tell: they meet neither hair nor volumes.
    """
    rays, points = Rays(scene), [points.mean(0) for points in world_points(subject)]
    unmet = any(item.type in BOXED for item, _, _ in instances(subject))
    eyes = (placed[0].spacing * np.multiply(profile.views, np.subtract(at, 1) / 2) for at in np.ndindex(3, 3))
    if not points or unmet or any(hit and hit[2] in subject for eye in eyes for hit in through(rays, placed, eye=eye)):
        return None
    return Notice("array-blind", {"seen": _seen_names(rays, placed), "place": _place(np.mean(points, axis=0), placed)})


def _seen_names(rays: Rays, placed: Placement) -> list[str]:
    """Names of the objects that most rays meet."""
    seen = collections.Counter(hit[2].name for hit in through(rays, placed) if hit)
    return [name for name, _ in seen.most_common(MOST_NAMES)]


def _place(point: Array, placed: Placement) -> str:
    """Where a world point (3,) lies that a camera does not see."""
    array, (x, y, z) = placed[0], mathutils.Matrix(placed[1]).inverted() @ mathutils.Vector(point)
    x, y = x / array.half_width * array.distance, y / array.half_height * array.distance
    if z <= 0:
        return "behind"
    if max(abs(x), abs(y)) > z:
        return ("right" if x > 0 else "left") if abs(x) >= abs(y) else "above" if y > 0 else "below"
    return "beyond" if array.clip and z > array.clip[1] else "hidden"


def fit_array(low: Array, high: Array, profile: DisplayProfile) -> Placement:
    """Return an array in front of a box of world corners ``low``, ``high`` (3,), looking along +Y with Z up.

    The display plane halves the box's depth. The display keeps its proportions and is as wide as the
    box's front needs to fill FILL of it, or wider where the depth would leave the display's usable range.
    """
    half, centre = (high - low) / 2, (low + high) / 2
    near, aspect = profile.viewing_distance_mm / profile.panel_mm[0], profile.panel_mm[1] / profile.panel_mm[0]
    flat = 2 * max(half[0], half[2] / aspect)
    width = flat / FILL + half[1] / near
    usable = min(profile.depth_range_mm()) / profile.panel_mm[0]
    width = max(width, min(half[1] / usable, flat / LEAST_FILL + half[1] / near))
    if not width > 0:
        raise LfsrError("the subject has no size: give its objects geometry or choose another subject")
    array, turn = CameraArray.for_display(profile, float(width)), mathutils.Matrix.Rotation(math.pi / 2, 4, "X")
    return array, from_blender(mathutils.Matrix.Translation((centre[0], centre[1] - array.distance, centre[2])) @ turn)


def moves(item: bpy.types.Object) -> bool:
    """Return True if an object, or one that it follows, is animated or has a constraint."""
    return bool(item.animation_data or item.constraints) or (item.parent is not None and moves(item.parent))


def array_of_camera(scene: bpy.types.Scene, profile: DisplayProfile, subject: set[bpy.types.Object]) -> Placement:
    """Return an array that shows what the scene's camera sees, at its place, towards the middle of its picture.

    The display plane is where the camera focuses, else where the visible subject's nearest and farthest points have
    equal parallax. Views are closer together where the array would reach through a wall: of a camera that stands still,
    in any frame of the animation. An orthographic camera has no eye: the display shows as much, and viewers stand at
    their distance from it.
    """
    camera, aspect = scene.camera, profile.panel_mm[0] / profile.panel_mm[1]
    if camera.data.type not in ("PERSP", "ORTHO"):
        raise LfsrError(f"the scene's camera is of type {camera.data.type}, but a camera array needs a perspective or "
                        "an orthographic one: change its type or remove it")

    def look() -> tuple[Placement, float]:
        """Return the place of the camera's eye with its frame at distance 1, and how far behind the camera it is."""
        corners = camera.data.view_frame(scene=scene)
        sizes = [max(c[axis] for c in corners) - min(c[axis] for c in corners) for axis in (0, 1)]
        back = PARALLEL * max(sizes) if camera.data.type == "ORTHO" else 0.0
        across, down = (size / 2 / (back or -corners[0].z) for size in sizes)
        clip = camera.data.clip_start + back, camera.data.clip_end + back  # to which the camera's scale does not apply
        x, y, depth = np.mean(corners, 0)  # of the middle of a shifted picture
        turn = mathutils.Vector((0, 0, -1)).rotation_difference((x, y, depth)).to_matrix().to_4x4()
        start = mathutils.Matrix.Translation((x, y, back)) if back else turn
        return (CameraArray(1.0, across, down, 0.0, clip), from_blender(upright(camera) @ start)), back

    def framed(seen: Placement) -> Placement:
        """Return the eye of ``look`` with a frame of the display's proportions."""
        width = max(seen[0].half_width, min(tall, 1.0) * seen[0].half_height * aspect)
        return dataclasses.replace(seen[0], half_width=width, half_height=width / aspect), seen[1]

    key = scene.session_uid, camera.session_uid, profile, frozenset(item.session_uid for item in subject)
    if (field := fields.get(key) if fields is not None else None) is None:
        (first, last), tall, depths, free = frame_range(scene), 0.0, np.empty(0), math.inf
        frames = () if moves(camera) else spread(range(first, last + 1), CAMERA_FRAMES)
        for is_measured in (False, True):
            for _ in visited(scene, frames):
                seen, rays = look()[0], Rays(scene)
                if is_measured:
                    depths = np.append(depths, seen_depths(scene, framed(seen), subject, rays))
                    free = min(free, _free(rays, framed(seen), profile))
                elif seen[0].half_height * aspect > seen[0].half_width:
                    # A tall frame: the display must show the height of all but backdrops.
                    met, toward = collections.defaultdict[bpy.types.Object, list[Array]](list), np.linalg.inv(seen[1])
                    for hit in filter(None, through(rays, seen)):
                        x, y, z = toward[:3, :3] @ hit[0] + toward[:3, 3]
                        met[hit[2]].append(np.divide((x / z, y / z), (seen[0].half_width, seen[0].half_height)))
                    inner = [points for points in map(np.array, met.values()) if np.ptp(points[:, 0]) < 2 * COVERED]
                    tall = max([tall, *(float(np.abs(points[:, 1]).max()) + 2 / PROBES[1] for points in inner)])
                else:
                    break
        field = tall, depths, free
        if fields is not None and frames:
            fields[key] = field
    tall, depths, free = field
    seen, back = look()
    seen = framed(seen)
    if not (distance := None if back else _focus(camera)):
        if not len(depths := depths if len(depths) else seen_depths(scene, seen, subject)):
            names = ", ".join(_seen_names(Rays(scene), seen))
            raise LfsrError(f"the scene's camera does not see the subject{f' but {names}' if names else ''}: turn the "
                            f"camera, choose another camera (or {FIT!r}), or choose another subject")
        distance = float(np.percentile(depths, 2)) if back else middle(depths)  # parallel: nearer things would grow
    if back:
        array = CameraArray.for_display(profile, 2 * seen[0].half_width * back)
        behind, ends = array.distance - distance, seen[0].clip or (0.0, MOST_REACH)
        array = dataclasses.replace(array, clip=(max(0.0, ends[0] + behind), ends[1] + behind))
        # From the camera, since the eye of a parallel picture is far away for floats.
        (x, y, _), matrix = np.mean(camera.data.view_frame(scene=scene), 0), mathutils.Matrix(seen[1])
        centre = upright(camera) @ mathutils.Vector((x, y, back - distance))
        matrix.translation = centre - array.distance * matrix.col[2].to_3d()
        return array, tuple(map(tuple, matrix))
    return _array_at(seen, profile, distance, free)


def array_of_view(scene: bpy.types.Scene, profile: DisplayProfile, subject: set[bpy.types.Object],
                  view: View) -> Placement:
    """Return an array where the eye of a perspective 3D view is.

    The display plane is as of ``array_of_camera``; where the view sees nothing of the subject, at the view's centre.
    """
    half_height = view.half_width * profile.panel_mm[1] / profile.panel_mm[0]
    seen = CameraArray(1.0, view.half_width, half_height, 0.0, view.clip), from_blender(mathutils.Matrix(view.matrix))
    depths = seen_depths(scene, seen, subject, rays := Rays(scene))
    return _array_at(seen, profile, middle(depths if len(depths) else [view.pivot]), _free(rays, seen, profile))


def _array_at(seen: Placement, profile: DisplayProfile, distance: float, free: float) -> Placement:
    """Array where an eye is whose frame is known at distance 1; views fit between walls.

    The display plane stays where disparities are least: their range is proportional to the spacing, wherever it is.
    """
    array = CameraArray.for_display(profile, 2 * seen[0].half_width * distance, distance)
    return dataclasses.replace(array, spacing=min(array.spacing, free), clip=seen[0].clip), seen[1]


def bounds(subject: set[bpy.types.Object]) -> tuple[Array, Array]:
    """Return the lowest and highest world corner (3,) of the subject's render geometry, with instances."""
    corners = [corner for points in world_points(subject) for corner in (points.min(0), points.max(0))]
    if not corners:
        raise LfsrError("the subject has no visible geometry: make its objects visible or choose another subject")
    return np.min(corners, axis=0), np.max(corners, axis=0)


def world_points(subject: set[bpy.types.Object], small: float = 0.0) -> Iterator[Array]:
    """World vertices (n, 3) of each object and instance that is rendered; of those below ``small``, box corners."""
    corners, clouds = dict[int, Array](), dict[int, Array]()  # by the geometry, as in ``boxes``
    for item, _, matrix in instances(subject):
        if item.type != "MESH" and item.type not in BOXED:
            continue
        if (geometry := item.data.as_pointer()) not in corners:
            corners[geometry] = np.array(item.bound_box, np.float32)
        points = corners[geometry]
        if item.type == "MESH" and not 0 < np.linalg.norm(matrix[:3, :3] @ (points[6] - points[0])) < small:
            if geometry not in clouds:
                mesh = item.to_mesh()
                cloud = clouds[geometry] = np.empty((len(mesh.vertices), 3), np.float32)
                mesh.vertices.foreach_get("co", cloud.ravel())
                # Vertices without a face that has an area are not rendered; in a large mesh the search takes long.
                if (count := len(mesh.loop_triangles)) < MOST_TRIANGLES:
                    triangles = np.empty((count, 3), np.int32)
                    mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
                    sides = cloud[triangles[:, 1:]] - cloud[triangles[:, :1]]
                    has_area = np.abs(np.cross(*sides.swapaxes(0, 1))).max(1) > NEEDLE * (sides**2).max((1, 2))
                    clouds[geometry] = cloud[np.unique(triangles[has_area])]
                item.to_mesh_clear()
            points = clouds[geometry]
        if len(points):
            yield points @ matrix[:3, :3].T + matrix[:3, 3]


def boxes(subject: set[bpy.types.Object]) -> tuple[list[bpy.types.Object], Array]:
    """Return the owners, and the world corners (n, 8, 3) of the bounding boxes, of all that the subject shows."""
    shapes = dict[int, Array]()  # by the geometry, which is an object's own where modifiers change it
    owners, corners, places = [], [], []
    for item, owner, place in instances(subject):
        if (item.type == "MESH" or item.type in BOXED) and not owner.hide_render:
            if (geometry := item.data.as_pointer()) not in shapes:
                shapes[geometry] = np.array(item.bound_box)
            owners.append(owner)
            corners.append(shapes[geometry])
            places.append(place)
    matrices = np.array(places).reshape(-1, 4, 4)
    return owners, (np.einsum("nij,nkj->nki", matrices[:, :3, :3], np.array(corners).reshape(-1, 8, 3))
                    + matrices[:, None, :3, 3])


def instances(subject: set[bpy.types.Object]) -> Iterator[tuple[bpy.types.Object, bpy.types.Object, Array]]:
    """Evaluated object, original owner and world matrix (4, 4) of each object and instance of the subject.

    Curves, surfaces, texts and metaballs come with an instance of their mesh, unless they are bare, such as a path.
    """
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    matrices = np.empty(16 * len(shown), np.float32)
    shown.foreach_get("matrix_world", matrices)  # in columns; one by one, those of thousands take long
    for instance, place in zip(shown, matrices.reshape(-1, 4, 4).swapaxes(1, 2).astype(float), strict=True):
        item = instance.object
        owner = (instance.parent if instance.is_instance else item).original
        if owner in subject or item.original in subject:
            yield item, owner, place


def _focus(camera: bpy.types.Object) -> float | None:
    depth_of_field = camera.data.dof
    if not depth_of_field.use_dof:
        return None
    if depth_of_field.focus_object is None:
        return depth_of_field.focus_distance
    toward = upright(camera).inverted() @ depth_of_field.focus_object.matrix_world.translation
    return -toward.z if toward.z < 0 else None


def middle(depths: Sequence[float] | Array) -> float:
    """Return the depth of equal parallax to the nearest and the farthest of ``depths``."""
    return balanced(*map(float, np.percentile(depths, (2, 98))))


def balanced(near: float, far: float) -> float:
    """Return the distance of the display plane from which both have the same parallax."""
    return 2 / (1 / near + 1 / far)


def narrowed(rays: Rays, placed: Placement, profile: DisplayProfile, distance: float) -> CameraArray:
    """Return an array with views so close together that it reaches no wall with its display plane at ``distance``."""
    array, free = placed[0], _free(rays, placed, profile)
    return dataclasses.replace(array, spacing=min(array.spacing, free * array.distance / distance))


def _free(rays: Rays, placed: Placement, profile: DisplayProfile) -> float:
    """Largest spacing of views with which an array at this place reaches no wall, not even its corners."""
    array, matrix, free = placed[0], mathutils.Matrix(placed[1]), math.inf
    for turn in itertools.product((-1, 0, 1), repeat=2):
        way = matrix.to_3x3() @ mathutils.Vector((*np.multiply(profile.views, turn) / 2, 0))  # for a spacing of 1
        corner = mathutils.Vector((*np.multiply(array.half_size, turn), array.distance))
        start = matrix @ (array.clip_start / array.distance * corner)
        if any(turn) and (hit := rays.cast(start, way)) is not None:
            free = min(free, WALL_MARGIN * (hit[0] - start).length / way.length)
    return free


def scale_of(scene: bpy.types.Scene, request: Request) -> ScaleChoice:
    """Choose one of the request's scales by the depths at which the middle of the array sees the subject."""
    global fields
    subject, moves, before = find_subject(scene, request.subject), [np.empty(0)], fields
    fields = {} if fields is None else fields
    try:
        for _ in visited(scene, request.sampling.frames):
            with suppress(LfsrError):  # no array where the subject is out of sight; the render of the frame reports it
                moves.append(moves_of(scene, request.display, subject))
    finally:
        fields = before
    return choose_scale(request.display, np.concatenate(moves), request.sampling.scales, request.judged_rays)


@as_rendered()
def moves_of(scene: bpy.types.Scene, display: DisplayProfile, subject: set[bpy.types.Object]) -> Array:
    """Disparities (n,), in lenses, of what the middle of the array sees of the ``subject`` in the current frame."""
    placed = place_array(scene, display, subject)
    return disparities(display, placed[0], seen_depths(scene, placed, subject))


def sample_frames(scene: bpy.types.Scene) -> Iterator[int]:
    """Set the scene to sample frames of its animation in turn, yield their numbers, and restore its current frame.

    A scene without animation yields its current frame only.
    """
    first, last = frame_range(scene)
    return visited(scene, spread(range(first, last + 1), MOST_FRAMES))


def visited(scene: bpy.types.Scene, numbers: Collection[int]) -> Iterator[int]:
    """As ``sample_frames``, but of these ``numbers``; the current frame only where there are none."""
    driven = any(item.animation_data and item.animation_data.drivers for item in bpy.data.objects)
    if not numbers or not (driven or any(action.users for action in bpy.data.actions) or bpy.data.cache_files):
        yield scene.frame_current
        return
    with same_frame(scene):
        for number in numbers:
            scene.frame_set(number)
            yield number


@contextmanager
def same_frame(scene: bpy.types.Scene) -> Iterator[None]:
    """Restore the current frame of ``scene`` after the block, its camera, and changes that have no keys yet."""
    before, camera, kept = (scene.frame_current, scene.frame_subframe), scene.camera, []
    for owner in (*bpy.data.objects, *bpy.data.shape_keys, *bpy.data.lights, *bpy.data.cameras):
        for path in {curve.data_path for curve in curves(owner)}:
            holder, _, name = path.rpartition(".")
            with suppress(AttributeError, TypeError, ValueError):  # a property of the artist's own, or one that is gone
                holder = owner.path_resolve(holder) if holder else owner
                kept.append((holder, name, copy(getattr(holder, name))))
    try:
        yield
    finally:
        if (scene.frame_current, scene.frame_subframe) != before:
            scene.frame_set(before[0], subframe=before[1])
        scene.camera = camera  # also where the block ended at the frame that it began at
        for holder, name, value in kept:
            with suppress(AttributeError, ReferenceError):  # linked, or removed in the block
                if getattr(holder, name) != value:
                    setattr(holder, name, value)


def frame_range(scene: bpy.types.Scene) -> tuple[int, int]:
    """Return the first and last frame of the scene, cut to its keyframes (imported files often have few)."""
    ranges = [tuple(action.frame_range) for action in bpy.data.actions if action.users]
    if not ranges or bpy.data.cache_files:
        return scene.frame_start, scene.frame_end
    first, last = int(min(low for low, _ in ranges)), int(np.ceil(max(high for _, high in ranges)))
    first, last = max(first, scene.frame_start), min(last, scene.frame_end)
    return (first, last) if first <= last else (scene.frame_start, scene.frame_end)
