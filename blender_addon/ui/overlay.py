"""Draw the camera array in the 3D views: frustum, display rectangle and limits of usable depth."""

from __future__ import annotations

import math

import bpy
import gpu
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

from ..scene import settings as scene_settings
from ..scene.array import cached, rig
from . import array_view
from .drawing import draw_points

DISPLAY_COLOR, FRUSTUM_COLOR = (0.36, 0.78, 1.0), (0.75, 0.85, 0.95)
USABLE_COLOR, SPARSE_COLOR = (1.0, 0.62, 0.25), (0.55, 1.0, 0.55)
BEYOND = 4.0  # display distances up to which an unlimited range is drawn
CORNERS = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)])

Lines = tuple[tuple[float, ...], float, float, Array]


def rectangle(array: CameraArray, distance: float) -> Array:
    """Corners (4, 3) in array space of what the display shows at ``distance``, from bottom left, in order."""
    x, y = array.half_width * distance / array.distance, array.half_height * distance / array.distance
    return CORNERS * (x, y, distance)


def viewing_zone(array: CameraArray, display: DisplayProfile) -> Array:
    """Corners (4, 3) of the cameras' rectangle at the viewing position."""
    x, y = (count * array.spacing / 2 for count in display.views)
    return CORNERS * (x, y, 0)


def lines(array: CameraArray, display: DisplayProfile, scale: int) -> list[Lines]:
    """(colour, opacity, width in pixels, points (2n, 3) in array space) of each set of lines."""
    near, far = rig.usable_depth(array, display)
    seen_far = far if math.isfinite(far) else BEYOND * array.distance
    plane, zone = rectangle(array, array.distance), viewing_zone(array, display)
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


def draw() -> None:
    """Draw handler of the 3D views, in world space."""
    context = bpy.context
    scene, space = context.scene, context.space_data
    if not scene.lfsr.show_frustum or not space.overlay.show_overlays or array_view.is_looking(space, scene):
        return
    array = cached.find(scene)
    if array is None or not array.visible_get():
        return
    try:
        settings = scene_settings.resolve(scene)
        placed = cached.placement(scene, settings.display)
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


DRAWN = (("POST_VIEW", draw),)
