"""Stereo pairs: what two eyes in front of the display see, side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions
from lfsr_core.exports.pictures import on_screen, save_png, usual_width

EYES_MM = 63.0


def write(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """Write one picture, the left eye's half on the left; the notes."""
    between = options.eyes_mm or EYES_MM
    check_zone(field, between / 2, f"eyes {between:g} mm apart")
    width = options.width or usual_width(field.display)
    pair = [on_screen(field.seen_from(x), field.display, width) for x in (-between / 2, between / 2)]
    save_png(folder / f"{field.name}_stereo_{between:g}mm.png", np.concatenate(pair, axis=1))
    return []


def check_zone(field: LightField, x_mm: float, what: str) -> None:
    """LfsrError unless an eye ``x_mm`` beside the middle is still in the viewing zone."""
    half = field.display.camera_spacing_mm * field.count[0] / 2
    if x_mm > half:
        raise LfsrError(f"{what} are outside the viewing zone of display {field.display.name!r}, which is "
                        f"{2 * half:.0f} mm wide at the viewing distance: choose less")
