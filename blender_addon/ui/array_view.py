"""Look through the camera array: the view of the display's centre, with the display's own frame."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import blf
import bpy
import gpu
import mathutils
from bpy_extras.view3d_utils import location_3d_to_region_2d

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile

from ..jobs import images
from ..scene import settings as scene_settings
from ..scene.array import cached, rig
from ..scene.array.placement import View
from .drawing import draw_points

FILL = 0.92  # of the 3D view's free part
MARGIN_COLOR, FRAME_COLOR = (0.0, 0.0, 0.0, 0.5), (0.36, 0.78, 1.0, 1.0)
TEXT_SIZE, TEXT_GAP = 12, 6  # pixels at the usual size of the interface
SECONDS_BETWEEN_CHECKS = 0.3
ZOOMS = (-30.0, 600.0)  # Blender's least and most
GUIDES = "show_camera_guides"  # since Blender 5.0: the frame of the scene's own resolution

_before: dict[int, Before] = {}  # by 3D view


@dataclasses.dataclass(frozen=True)
class Before:
    """A 3D view as it was before it looked through the array."""

    space: dict[str, Any]
    region: dict[str, Any]
    overlay: dict[str, Any]
    place: dict[str, Any]  # where its eye was


def camera_of(space: bpy.types.SpaceView3D, scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the camera that a 3D view looks through, None if it looks freely."""
    if space.region_3d.view_perspective != "CAMERA":
        return None
    return space.camera if space.use_local_camera else scene.camera


def is_looking(space: bpy.types.SpaceView3D | None, scene: bpy.types.Scene) -> bool:
    """Return True if a 3D view looks through a camera array."""
    return space is not None and rig.is_array(camera_of(space, scene))


def enter(area: bpy.types.Area, scene: bpy.types.Scene) -> None:
    """Make a 3D view look through the array, with the display's frame in its middle; LfsrError without an array."""
    display = scene_settings.display_of(scene)
    array = rig.find(scene)
    if array is None or rig.placement(scene, display) is None:
        raise LfsrError("there is no camera array to look through: add one")
    space = area.spaces.active
    region = space.region_3d
    _before[space.as_pointer()] = Before(
        _values(space, "use_local_camera", "camera", "lock_camera"),
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
    before = _before.pop(space.as_pointer(), None)
    if before is None:
        space.region_3d.view_perspective = "PERSP"
        return
    _set(space.region_3d, before.place)
    _give_back(space, before)


def _give_back(space: bpy.types.SpaceView3D, before: Before) -> None:
    for item, values in ((space, before.space), (space.region_3d, before.region), (space.overlay, before.overlay)):
        _set(item, values)


def _watch() -> float | None:
    """Timer: a view that was turned away, or looks through another camera, gets its own settings back."""
    spaces = {area.spaces.active.as_pointer(): area.spaces.active for area in images.areas("VIEW_3D")}
    for key in list(_before):
        space = spaces.get(key)
        if space is None:
            del _before[key]
        elif space.region_3d.view_perspective != "CAMERA" or not rig.is_array(space.camera):
            _give_back(space, _before.pop(key))
    return SECONDS_BETWEEN_CHECKS if _before else None


def _values(item: Any, *names: str) -> dict[str, Any]:
    values = {name: getattr(item, name) for name in names if hasattr(item, name)}
    return {name: tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
            for name, value in values.items()}


def _set(item: Any, values: dict[str, Any]) -> None:
    for name, value in values.items():
        setattr(item, name, value)


def _frame(area: bpy.types.Area, region: bpy.types.RegionView3D, display: DisplayProfile) -> None:
    """Zoom and shift the camera's view, so that the display's frame fills the free part of the 3D view."""
    main = next(each for each in area.regions if each.type == "WINDOW")
    left, bottom, right, top = free_part(area)
    width = FILL * min(right - left, (top - bottom) * display.panel_mm[0] / display.panel_mm[1])
    # Blender's factor of a zoom z is (√2 + z / 50)² / 4, and 1 makes the camera's frame as wide as the region.
    zoom = 50 * (2 * math.sqrt(width / main.width) - math.sqrt(2))
    region.view_camera_zoom = min(max(zoom, ZOOMS[0]), ZOOMS[1])
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
    placed = cached.placement(scene, scene_settings.display_of(scene))
    if placed is None:
        return []
    array, matrix = placed
    x, y, to_world = array.half_width, array.half_height, mathutils.Matrix(matrix)
    corners = ((-x, -y), (x, -y), (x, y), (-x, y))
    points = [location_3d_to_region_2d(region, view, to_world @ mathutils.Vector((*corner, array.distance)))
              for corner in corners]
    return [] if any(point is None for point in points) else points


def draw() -> None:
    """Draw handler of the 3D views, in pixels: the display's frame, its name, and what lies outside in the dark."""
    context = bpy.context
    scene, region = context.scene, context.region
    if not context.space_data.overlay.show_overlays or not is_looking(context.space_data, scene):
        return
    try:
        corners, display = frame_corners(scene, region, context.region_data), scene_settings.display_of(scene)
    except LfsrError:
        return  # the panel shows what is wrong
    if corners:
        _draw_frame(corners, (region.width, region.height), display.title or display.name)


def _draw_frame(corners: list[mathutils.Vector], size: tuple[int, int], title: str) -> None:
    (left, bottom), (right, top) = corners[0], corners[2]
    scale = bpy.context.preferences.system.ui_scale
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
    blf.draw(0, title)


def unregister() -> None:
    """Views that look through the array get their own settings back."""
    for area in images.areas("VIEW_3D"):
        if area.spaces.active.as_pointer() in _before:
            leave(area)
    if bpy.app.timers.is_registered(_watch):
        bpy.app.timers.unregister(_watch)


DRAWN = (("POST_PIXEL", draw),)
