"""Depth of a finished frame: disparity of its central view, and RGB-D images."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.exports.light_field import LightField, on_screen, usual_width
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames.frame import LOW_RES_FILE, Frame
from lfsr_core.frames.low_res import low_resolution
from lfsr_core.images.exr import read_finite
from lfsr_core.images.png import write_png

LEAST_SPAN = 1e-6  # of disparities, in pixels per view


def central_disparity(field: LightField) -> Array | None:
    """Disparity (sy, sx) float32 at the centre of the cameras; None where the frame has no position layer.

    In pixels (lenses) per finished view, positive in front of the display plane: a camera one step to the right sees
    a point that many pixels further left, one step up that many further down. Empty pixels have that of infinity.
    """
    rendered = rendered_disparity(field)
    if rendered is None:
        return None
    seen, array, (sx, sy) = rendered.disparity, field.frame.array, field.display.lenses
    right, down = (place - (count - 1) / 2 for place, count in zip(rendered.place, field.count, strict=True))
    down = down * array.half_width / sx / (array.half_height / sy)  # in lenses across, which may not be square
    # One step of a fixed-point iteration, enough for the fractions of a pixel between the centre and the nearest view.
    rows, columns = np.indices(seen.shape)
    column = np.clip(np.rint(columns - right * seen), 0, seen.shape[1] - 1).astype(int)
    row = np.clip(np.rint(rows - down * seen), 0, seen.shape[0] - 1).astype(int)
    return np.asarray(seen[row, column])


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
    assert low.position is not None, "the layers have it"
    hit = low.alpha[:, :, row, column, 0] > 0
    to_array = np.linalg.inv(np.asarray(field.frame.matrix_world, float))
    distance = low.position[:, :, row, column] @ to_array[2, :3] + to_array[2, 3]  # from the camera plane
    depth, array = np.where(hit, distance, np.inf), field.frame.array
    nearness = array.distance / np.maximum(depth, 1e-6 * array.distance)
    return Rendered(np.asarray((1 - nearness) * infinite_disparity(field.frame), np.float32),
                    ((column + 0.5) * steps[0] - 0.5, (row + 0.5) * steps[1] - 0.5))


def infinite_disparity(frame: Frame) -> float:
    """Disparity at infinity, in pixels (lenses) per finished view."""
    pixel = 2 * frame.array.half_width / frame.display.lenses[0]
    return float(np.float32(-frame.array.spacing / pixel))


def write_rgbd(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write colour left and depth right, near is white, as Looking Glass' programs take them.

    Depth is linear in disparity; tells where on it the display's plane is.
    """
    rendered = rendered_disparity(field)
    if rendered is None:
        raise LfsrError(f"{field.folder} has no position layer, from which depth comes: render it with the "
                        "layer position")
    color = on_screen(field.view_at(*rendered.place), field.display, options.width or usual_width(field.display))
    disparity, infinite = rendered.disparity, infinite_disparity(field.frame)
    hit = disparity[disparity > infinite]
    far, near = (float(hit.min()), float(hit.max())) if hit.size else (infinite, 0.0)
    if near - far < LEAST_SPAN:  # all at one depth: emptiness is behind it
        far = min(infinite, near - LEAST_SPAN)
    nearness = np.clip((disparity - far) / (near - far), 0, 1)  # emptiness is as far as the farthest that is hit
    rows, columns = (np.arange(size) * count // size
                     for size, count in zip(color.shape[:2], nearness.shape, strict=True))
    grey = np.rint(nearness[rows][:, columns] * 255).astype(np.uint8)  # the nearest lens: no depth between two things
    write_png(folder / f"{field.name}_rgbd.png", np.concatenate([color, np.repeat(grey[..., None], 3, 2)], axis=1))
    options.tell(Notice("display-plane", {"depth": float(np.clip(-far / (near - far), 0, 1))}))
