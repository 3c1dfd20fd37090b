"""Views of one display for another: the same picture, its depth scaled with its size, seen from the same angles."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.exports.light_field import view_between
from lfsr_core.exports.screen_images import resized
from lfsr_core.optics.display import DisplayProfile


@dataclasses.dataclass(frozen=True)
class Source:
    """Views of others."""

    views: Array  # (rows, columns, height, width, 3) uint8, row 0 the topmost cameras, column 0 the leftmost
    aspect: float  # width / height of the picture, whose pixels need not be square
    # whether neighbouring cameras differ by one angle, as in quilts; else by one distance
    equal_angles: bool


def retargeted(source: Source, display: DisplayProfile, angle_deg: float | None = None, fill: bool = False) -> Array:
    """Views (py, px, sy, sx, 3) uint8 for ``display``.

    Parameters
    ----------
    source : the views
    display : that they are shown on
    angle_deg : over which the cameras of ``source`` are spread horizontally; beyond it the outermost view repeats.
        None: the display's own angle
    fill : whether the picture fills the display and is cut; else all of it is seen, between black bars
    """
    wider = source.aspect / (display.panel_mm[0] / display.panel_mm[1])
    across = max(1.0, wider) if fill else min(1.0, wider)
    covers = (across, across / wider)
    views = np.stack([[resized(view, display.lenses, covers) for view in row] for row in source.views])
    columns, rows = _places(source, display, math.radians(angle_deg or display.viewing_angle_deg))
    return np.stack([np.stack([view_between(views, column, row) for column in columns]) for row in rows])


def _places(source: Source, display: DisplayProfile, angle: float) -> tuple[Array, Array]:
    """Places of the display's cameras among those of the source: columns and rows."""
    down, across = source.views.shape[:2]
    tangents = [(np.arange(count) + 0.5 - count / 2) * display.camera_spacing_mm / display.viewing_distance_mm
                for count in display.views]
    span = 2 * math.tan(angle / 2)
    fraction = np.arctan(tangents[0]) / angle if source.equal_angles else tangents[0] / span
    # Rows are as far apart as columns.
    return (fraction + 0.5) * across - 0.5, tangents[1] / span * across + (down - 1) / 2
