"""Stereo pairs: the views of two eyes in front of the display, side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions
from lfsr_core.exports.screen_images import on_screen, usual_width
from lfsr_core.images.png import write_png

EYES_MM = 63.0


def write(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """Write one image, the left eye's half on the left; return the notes."""
    between = options.eyes_mm or EYES_MM
    zone = field.display.camera_spacing_mm * field.count[0]
    if between > zone:
        raise LfsrError(f"eyes {between:g} mm apart are outside the viewing zone of display {field.display.name!r}, "
                        f"which is {zone:.0f} mm wide at the viewing distance: choose a smaller distance")
    width = options.width or usual_width(field.display)
    pair = [on_screen(field.seen_from(x), field.display, width) for x in (-between / 2, between / 2)]
    write_png(folder / f"{field.name}_stereo_{between:g}mm.png", np.concatenate(pair, axis=1))
    return []
