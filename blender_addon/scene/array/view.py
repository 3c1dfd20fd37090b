"""What a 3D view shows: where its eye is, and the part of it that no other region covers."""

from __future__ import annotations

import dataclasses

import bpy
import mathutils

from lfsr_core.frames.frame import Clip
from lfsr_core.optics.display import DisplayProfile


@dataclasses.dataclass(frozen=True)
class View:
    """A 3D view, and the largest frame of the display's aspect in its middle."""

    matrix: mathutils.Matrix  # world matrix of its eye, in parallel of the point it turns around; looks along -Z
    half_width: float  # of the frame: at depth 1 in perspective, else everywhere
    pivot: float  # depth of the point that the view turns around, in perspective
    clip: Clip
    is_perspective: bool


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


def of_area(area: bpy.types.Area, profile: DisplayProfile) -> View:
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
