"""The camera array in the 3D views: its frustum, display and limits of usable depth, and the view through it.

The view through the array is that of the display's centre, in the display's own frame.
"""

import math
from collections.abc import Sequence
from typing import Any

import blf
import bpy
import gpu
import mathutils
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..compat import assign, copied
from ..jobs import images
from ..scene import settings as scene_settings
from ..scene.array import rig
from ..scene.array.placement import View

FILL = 0.92  # of the 3D view's free part
MARGIN_COLOR, FRAME_COLOR = (0.0, 0.0, 0.0, 0.5), (0.36, 0.78, 1.0, 1.0)
TEXT_SIZE, TEXT_GAP = 12, 6  # pixels at the usual size of the interface
SECONDS_BETWEEN_CHECKS = 0.3
ZOOMS = (-30.0, 600.0)  # Blender's least and most
GUIDES = "show_camera_guides"  # since Blender 5.0: the frame of the scene's own resolution

DISPLAY_COLOR, FRUSTUM_COLOR = (0.36, 0.78, 1.0), (0.75, 0.85, 0.95)
USABLE_COLOR, SPARSE_COLOR = (1.0, 0.62, 0.25), (0.55, 1.0, 0.55)
BEYOND = 4.0  # display distances up to which an unlimited range is drawn
CORNERS = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)])
Lines = tuple[tuple[float, ...], float, float, Array]

# What a 3D view was like before it looked through the array: the name of a camera of its own, whether that is locked to
# the view, settings of region and overlay, and where its eye was.
Before = tuple[str, bool, dict[str, Any], dict[str, Any], dict[str, Any]]
_before: dict[int, Before] = {}  # by 3D view


def is_looking(space: bpy.types.SpaceView3D | None, scene: bpy.types.Scene) -> bool:
    """Return True if a 3D view looks through a camera array."""
    return (space is not None and space.region_3d.view_perspective == "CAMERA"
            and rig.is_array(space.camera if space.use_local_camera else scene.camera))


def enter(area: bpy.types.Area, scene: bpy.types.Scene) -> None:
    """Make a 3D view look through the array, with the display's frame in its middle; LfsrError without an array."""
    display = scene_settings.display_of(scene)
    if (array := rig.find(scene)) is None or rig.placement(scene, display) is None:
        raise LfsrError("there is no camera array to look through: add one")
    space = area.spaces.active
    region = space.region_3d
    _before[space.as_pointer()] = (
        space.camera.name if space.use_local_camera and space.camera else "", space.lock_camera,
        _values(region, "view_camera_zoom", "view_camera_offset"), _values(space.overlay, GUIDES),
        _values(region, "view_perspective", "view_location", "view_rotation", "view_distance"))
    space.use_local_camera, space.camera = True, array
    region.view_perspective = "CAMERA"
    if hasattr(space.overlay, GUIDES):
        setattr(space.overlay, GUIDES, False)
    _frame(area, region, display)
    if not bpy.app.timers.is_registered(_watch):
        bpy.app.timers.register(_watch, first_interval=SECONDS_BETWEEN_CHECKS)


def leave(area: bpy.types.Area) -> None:
    """Give a 3D view back the place and the settings that it had."""
    space = area.spaces.active
    if (before := _before.pop(space.as_pointer(), None)) is None:
        space.region_3d.view_perspective, space.use_local_camera = "PERSP", False
    else:
        assign(space.region_3d, before[-1])
        _give_back(space, before)


def _give_back(space: bpy.types.SpaceView3D, before: Before) -> None:
    name, space.lock_camera, region, overlay, _ = before
    space.use_local_camera = (camera := bpy.data.objects.get(name)) is not None
    if camera is not None:  # else the view shows the scene's camera, which this would change
        space.camera = camera
    assign(space.region_3d, region)
    assign(space.overlay, overlay)


def _watch() -> float | None:
    """Timer: a view that was turned away, or looks through another camera, gets its own settings back."""
    spaces = {area.spaces.active.as_pointer(): area.spaces.active for screen in bpy.data.screens
              for area in screen.areas if area.type == "VIEW_3D"}
    for key in list(_before):
        if (space := spaces.get(key)) is None:
            del _before[key]
        elif space.region_3d.view_perspective != "CAMERA" or not rig.is_array(space.camera):
            _give_back(space, _before.pop(key))
    return SECONDS_BETWEEN_CHECKS if _before else None


def _values(item: Any, *names: str) -> dict[str, Any]:
    return {name: copied(getattr(item, name)) for name in names if hasattr(item, name)}


def _frame(area: bpy.types.Area, region: bpy.types.RegionView3D, display: DisplayProfile) -> None:
    """Zoom and shift the camera's view, so that the display's frame fills the free part of the 3D view."""
    main = next(part for part in area.regions if part.type == "WINDOW")
    left, bottom, right, top = free_part(area)
    width = FILL * min(right - left, (top - bottom) * display.panel_mm[0] / display.panel_mm[1])
    # Blender's factor of a zoom z is (√2 + z / 50)² / 4, and 1 makes the camera's frame as wide as the region.
    region.view_camera_zoom = min(max(50 * (2 * math.sqrt(width / main.width) - math.sqrt(2)), ZOOMS[0]), ZOOMS[1])
    shift = [(main.width - left - right) / 2, (main.height - bottom - top) / 2]
    region.view_camera_offset = [pixels / 2 / main_side * main.width / width
                                 for pixels, main_side in zip(shift, (main.width, main.height), strict=True)]


def free_part(area: bpy.types.Area) -> tuple[int, int, int, int]:
    """Left, bottom, right and top of the 3D view's free part, in pixels of its main region.

    Sidebar, toolbar and headers lie over the main region.
    """
    main = next(region for region in area.regions if region.type == "WINDOW")
    left, bottom, right, top = 0, 0, main.width, main.height
    for region in area.regions:
        if region.type == "UI" and region.width > 1:
            right = min(right, region.x - main.x)
        elif region.type == "TOOLS" and region.width > 1:
            left = max(left, region.x + region.width - main.x)
        elif region.type in ("HEADER", "TOOL_HEADER") and region.height > 1 and region.y > main.y + main.height // 2:
            top = min(top, region.y - main.y)
    return (left, bottom, right, top) if right > left and top > bottom else (0, 0, main.width, main.height)


def view_of(area: bpy.types.Area, profile: DisplayProfile) -> View:
    """Return what the 3D view ``area`` shows, framed for a display."""
    space, main = area.spaces.active, next(region for region in area.regions if region.type == "WINDOW")
    region, (left, bottom, right, top) = space.region_3d, free_part(area)
    # The frame lies around the view's axis, which is the middle of the main region.
    across = min(right - main.width / 2, main.width / 2 - left) / (main.width / 2)
    down = min(top - main.height / 2, main.height / 2 - bottom) / (main.height / 2)
    half_width, half_height = (1 / region.window_matrix[i][i] for i in (0, 1))
    aspect = profile.panel_mm[0] / profile.panel_mm[1]
    return View(region.view_matrix.inverted(), min(across * half_width, down * half_height * aspect),
                region.view_distance, (space.clip_start, space.clip_end), region.is_perspective)


def frame_corners(scene: bpy.types.Scene, region: bpy.types.Region,
                  view: bpy.types.RegionView3D) -> list[mathutils.Vector]:
    """Return the display's corners in pixels of ``region``, from bottom left, in order; none without an array."""
    if (placed := rig.placed(*rig.drawn(scene), scene_settings.display_of(scene))) is None:
        return []
    array, matrix = placed
    x, y, to_world = array.half_width, array.half_height, mathutils.Matrix(matrix)
    corners = ((-x, -y), (x, -y), (x, y), (-x, y))
    points = [location_3d_to_region_2d(region, view, to_world @ mathutils.Vector((*corner, array.distance)))
              for corner in corners]
    return [] if any(point is None for point in points) else points


def draw_frame() -> None:
    """Draw handler of the 3D views, in pixels: the display's frame and name, and a dark margin around the frame."""
    context = bpy.context
    scene, region = context.scene, context.region
    if not context.space_data.overlay.show_overlays or not is_looking(context.space_data, scene):
        return
    try:
        corners, display = frame_corners(scene, region, context.region_data), scene_settings.display_of(scene)
    except LfsrError:
        return  # the panel shows what is wrong
    if not corners:
        return
    (left, bottom), (right, top) = corners[0], corners[2]
    size, scale = (region.width, region.height), context.preferences.system.ui_scale
    gpu.state.blend_set("ALPHA")
    try:
        for low, high in (((0, 0), (left, size[1])), ((right, 0), size), ((left, 0), (right, bottom)),
                          ((left, top), (right, size[1]))):
            draw_points("UNIFORM_COLOR", "TRIS", [low, (high[0], low[1]), high, (low[0], high[1])],
                        {"color": MARGIN_COLOR}, [(0, 1, 2), (0, 2, 3)])
        draw_points("POLYLINE_UNIFORM_COLOR", "LINE_LOOP", [(*corner, 0) for corner in corners], {
            "viewportSize": gpu.state.viewport_get()[2:], "color": FRAME_COLOR, "lineWidth": 2.0 * scale})
    finally:
        gpu.state.blend_set("NONE")
    blf.size(0, TEXT_SIZE * scale)
    blf.color(0, *FRAME_COLOR)
    blf.position(0, left + TEXT_GAP * scale, bottom + TEXT_GAP * scale, 0)
    blf.draw(0, display.title or display.name)


def rectangle(array: CameraArray, distance: float) -> Array:
    """Corners (4, 3) in array space of what the display shows at ``distance``, from bottom left, in order."""
    x, y = array.half_width * distance / array.distance, array.half_height * distance / array.distance
    return CORNERS * (x, y, distance)


def lines(array: CameraArray, display: DisplayProfile, scale: int) -> list[Lines]:
    """(colour, opacity, width in pixels, points (2n, 3) in array space) of each set of lines."""
    near, far = rig.usable_depth(array, display)
    seen_far = far if math.isfinite(far) else BEYOND * array.distance
    plane = rectangle(array, array.distance)
    zone = CORNERS * (*np.multiply(display.views, array.spacing / 2), 0)  # of the cameras, at the viewing position
    edges = np.stack([rectangle(array, near), rectangle(array, seen_far)], axis=1).reshape(-1, 3)
    sight = np.stack([np.zeros((4, 3)), rectangle(array, near)], axis=1).reshape(-1, 3)
    drawn: list[Lines] = [
        (FRUSTUM_COLOR, 0.35, 1.0, edges), (FRUSTUM_COLOR, 0.18, 1.0, sight), (FRUSTUM_COLOR, 0.7, 1.5, _loop(zone)),
        (DISPLAY_COLOR, 1.0, 2.5, _loop(plane)), (USABLE_COLOR, 0.9, 1.5, _loop(rectangle(array, near)))]
    if math.isfinite(far):
        drawn.append((USABLE_COLOR, 0.9, 1.5, _loop(rectangle(array, far))))
    if scale > 1:
        drawn += [(SPARSE_COLOR, 0.55, 1.0, _loop(rectangle(array, limit)))
                  for limit in rig.usable_depth(array, display, scale) if math.isfinite(limit)]
    return drawn


def _loop(corners: Array) -> Array:
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1).reshape(-1, 3)


def draw_array() -> None:
    """Draw handler of the 3D views, in world space."""
    context = bpy.context
    scene, space = context.scene, context.space_data
    if not scene.lfsr.show_frustum or not space.overlay.show_overlays or is_looking(space, scene):
        return
    array = rig.drawn(scene)[0]
    if array is None or not array.visible_get():
        return
    try:
        settings = scene_settings.resolve(scene)
        placed = rig.placed(*rig.drawn(scene), settings.display)
    except LfsrError:
        return  # the panel shows what is wrong
    if placed is None:
        return
    layout, to_world = placed[0], np.array(placed[1])
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)
    try:
        corners = _in_world(rectangle(layout, layout.distance), to_world)
        draw_points("UNIFORM_COLOR", "TRIS", corners, {"color": (*DISPLAY_COLOR, 0.06)}, [(0, 1, 2), (0, 2, 3)])
        for color, opacity, width, points in lines(layout, settings.display, settings.sampling.scale):
            draw_points("POLYLINE_UNIFORM_COLOR", "LINES", _in_world(points, to_world), {
                "viewportSize": gpu.state.viewport_get()[2:], "color": (*color, opacity),
                "lineWidth": width * context.preferences.system.ui_scale})
    finally:
        gpu.state.blend_set("NONE")
        gpu.state.depth_test_set("NONE")


def _in_world(points: Array, to_world: Array) -> list[tuple[float, ...]]:
    return [tuple(point) for point in points @ to_world[:3, :3].T + to_world[:3, 3]]


def draw_points(shader_name: str, kind: str, points: Sequence[tuple[float, ...]], uniforms: dict[str, Any],
                indices: list[tuple[int, ...]] | None = None) -> None:
    """Draw lines or triangles (``kind``) in a 3D view with one of Blender's shaders."""
    shader = gpu.shader.from_builtin(shader_name)
    batch = batch_for_shader(shader, kind, {"pos": points}, indices=indices)
    shader.bind()
    for name, value in uniforms.items():
        shader.uniform_float(name, value)
    batch.draw(shader)


def unregister() -> None:
    """Views that look through the array get their own settings back."""
    for area in images.areas("VIEW_3D"):
        if area.spaces.active.as_pointer() in _before:
            leave(area)
    if bpy.app.timers.is_registered(_watch):
        bpy.app.timers.unregister(_watch)


DRAWN = (("POST_VIEW", draw_array), ("POST_PIXEL", draw_frame))
