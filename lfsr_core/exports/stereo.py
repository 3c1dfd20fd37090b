"""Stereo pairs, the views of two eyes in front of the display: side by side, one above the other, or as an anaglyph."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.exports.light_field import LightField, on_screen, usual_width
from lfsr_core.exports.options import ExportOptions
from lfsr_core.images.png import write_png
from lfsr_core.images.srgb import srgb_decode, srgb_encode

EYES_MM = 63.0
# Left and right eye's linear red, green and blue to those of red-cyan glasses on a liquid crystal display: E. Dubois,
# "Conversion of a stereo pair to anaglyph with the least-squares projection method", March 2009.
DUBOIS = np.array([[[0.437, 0.449, 0.164], [-0.062, -0.062, -0.024], [-0.048, -0.050, -0.017]],
                   [[-0.011, -0.032, -0.007], [0.377, 0.761, 0.009], [-0.026, -0.093, 1.234]]], np.float32)


class Layout(NamedTuple):
    """How the two eyes' images, (H, W, 3) uint8, become one."""

    suffix: str  # in the file's name, by which players know the layout
    size: tuple[float, float]  # of each image, by a whole one's width and height
    joined: Callable[[Array, Array], Array]


def _side_by_side(left: Array, right: Array) -> Array:
    return np.concatenate([left, right], axis=1)


def _top_and_bottom(left: Array, right: Array) -> Array:
    return np.concatenate([left, right], axis=0)


def anaglyph(left: Array, right: Array) -> Array:
    """Image (H, W, 3) uint8 for red-cyan glasses, of two images of that shape."""
    eyes = np.stack([srgb_decode(image.astype(np.float32) / 255) for image in (left, right)])
    mixed = np.einsum("eoc,ehwc->hwo", DUBOIS, eyes)
    return np.asarray(np.rint(srgb_encode(np.clip(mixed, 0, 1)) * 255), np.uint8)


LAYOUTS = {
    "stereo": Layout("stereo", (1, 1), _side_by_side),
    "half-side-by-side": Layout("hsbs", (0.5, 1), _side_by_side),
    "top-bottom": Layout("tab", (1, 1), _top_and_bottom),
    "half-top-bottom": Layout("htab", (1, 0.5), _top_and_bottom),
    "anaglyph": Layout("anaglyph", (1, 1), anaglyph),
}


def write(layout: Layout, field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write one image, the left eye's half on the left or on top."""
    between = eye_distance(field, options)
    width = options.width or usual_width(field.display)
    pair = [on_screen(field.seen_from(x), field.display, width, layout.size) for x in (-between / 2, between / 2)]
    write_png(folder / f"{field.name}_{layout.suffix}_{between:g}mm.png", layout.joined(*pair))


def eye_distance(field: LightField, options: ExportOptions) -> float:
    """Millimetres between the eyes; LfsrError where they do not both see the display's views."""
    between = options.eyes_mm or EYES_MM
    zone = field.display.camera_spacing_mm * field.count[0]
    if between > zone:
        raise LfsrError(f"eyes {between:g} mm apart are outside the viewing zone of display {field.display.name!r}, "
                        f"which is {zone:.0f} mm wide at the viewing distance: choose a smaller distance")
    return between
