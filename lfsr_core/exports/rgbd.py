"""Colour and depth side by side, as Looking Glass' programs take them: colour left, depth right, near is white."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.exports.disparity import infinite_disparity, rendered_disparity
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions
from lfsr_core.exports.screen_images import on_screen, usual_width
from lfsr_core.images.png import write_png

LEAST_SPAN = 1e-6  # of disparities, in pixels per view


def write(field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one image, the grey of its right half linear in disparity; tell where on it the display's plane is."""
    rendered = rendered_disparity(field)
    if rendered is None:
        raise LfsrError(f"{field.folder} has no position layer, from which depth comes: render it with --layers "
                        "position")
    color = on_screen(field.view_at(*rendered.place), field.display, options.width or usual_width(field.display))
    nearness, plane = _nearness(rendered.disparity, infinite_disparity(field.frame))
    rows, columns = (np.arange(size) * count // size
                     for size, count in zip(color.shape[:2], nearness.shape, strict=True))
    grey = np.rint(nearness[rows][:, columns] * 255).astype(np.uint8)  # the nearest lens: no depth between two things
    write_png(folder / f"{field.name}_rgbd.png", np.concatenate([color, np.repeat(grey[..., None], 3, 2)], axis=1))
    options.tell(Notice("display-plane", {"depth": plane}))


def _nearness(disparity: Array, infinite: float) -> tuple[Array, float]:
    """Values (sy, sx) from 0, far, to 1, near, and that of the display's plane; emptiness is as far as what is hit."""
    hit = disparity[disparity > infinite]
    far, near = (float(hit.min()), float(hit.max())) if hit.size else (infinite, 0.0)
    if near - far < LEAST_SPAN:  # all at one depth: emptiness is behind it
        far = min(infinite, near - LEAST_SPAN)
    return np.clip((disparity - far) / (near - far), 0, 1), float(np.clip(-far / (near - far), 0, 1))
