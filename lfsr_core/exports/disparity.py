"""Disparity of the central view and of the rendered one beside it, from the position layer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.exports.light_field import LightField
from lfsr_core.frames.frame import LOW_RES_FILE, Frame
from lfsr_core.frames.low_res import LowResEIA, low_resolution
from lfsr_core.images.exr import read_finite


def central_disparity(field: LightField) -> Array | None:
    """Disparity (sy, sx) float32 at the centre of the cameras; None where the frame has no position layer.

    In pixels (lenses) per finished view, positive in front of the display plane: a camera one step to the right sees
    a point that many pixels further left, one step up that many further down. Empty pixels have that of infinity.
    """
    rendered = rendered_disparity(field)
    if rendered is None:
        return None
    right, down = (place - (count - 1) / 2 for place, count in zip(rendered.place, field.count, strict=True))
    array, (sx, sy) = field.frame.array, field.display.lenses
    # Disparity is in lenses across; convert the vertical offset where lenses are not square.
    return _from_the_middle(rendered.disparity, right, down * array.half_width / sx / (array.half_height / sy))


class Rendered(NamedTuple):
    """Disparity of a rendered view."""

    disparity: Array  # (sy, sx) float32, as of ``central_disparity``
    place: tuple[float, float]  # of its camera, as numbers of finished views (column, row)


def rendered_disparity(field: LightField) -> Rendered | None:
    """Disparity of the rendered view nearest to the centre; None where the frame has no position layer."""
    path = field.folder / LOW_RES_FILE
    if "position" not in field.frame.layers or not path.is_file() or field.frame.lens_list is not None:
        return None
    layers, _ = read_finite(path)
    if "position" not in layers:
        return None
    low = low_resolution(layers, field.frame)
    row, column = low.color.shape[2] // 2, low.color.shape[3] // 2
    steps = (field.count[0] / low.color.shape[3], field.count[1] / low.color.shape[2])  # in finished views
    return Rendered(_of_view(low, field.frame, row, column),
                    ((column + 0.5) * steps[0] - 0.5, (row + 0.5) * steps[1] - 0.5))


def _of_view(low: LowResEIA, frame: Frame, row: int, column: int) -> Array:
    """Disparity (sy, sx) of the view at ``row``, ``column`` of the low-resolution EIA."""
    assert low.position is not None, "the caller has checked it"
    hit = low.alpha[:, :, row, column, 0] > 0
    to_array = np.linalg.inv(np.asarray(frame.matrix_world, float))
    distance = low.position[:, :, row, column] @ to_array[2, :3] + to_array[2, 3]  # from the camera plane
    depth, array = np.where(hit, distance, np.inf), frame.array
    nearness = array.distance / np.maximum(depth, 1e-6 * array.distance)
    return np.asarray((1 - nearness) * infinite_disparity(frame), np.float32)


def infinite_disparity(frame: Frame) -> float:
    """Disparity at infinity, in pixels (lenses) per finished view."""
    pixel = 2 * frame.array.half_width / frame.display.lenses[0]
    return float(np.float32(-frame.array.spacing / pixel))


def _from_the_middle(seen: Array, right: float, down: float) -> Array:
    """Warp the disparity ``seen`` by a camera some steps right of the centre and below it to the centre.

    One step of a fixed-point iteration, enough for the fractions of a pixel between the centre and the nearest view.
    """
    rows, columns = np.indices(seen.shape)
    column = np.clip(np.rint(columns - right * seen), 0, seen.shape[1] - 1).astype(int)
    row = np.clip(np.rint(rows - down * seen), 0, seen.shape[0] - 1).astype(int)
    return np.asarray(seen[row, column])
