"""Images that are almost entirely black or white."""

from __future__ import annotations

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.notices import Notice

BLACK, WHITE = 8.5 / 255, 249.5 / 255  # display values
# Percentiles that are compared with these, so that a few sparks in the dark or specks on white do not count.
SPARKS, SPECKS = 99.5, 5.0


def exposure_notices(shown: Array, background: Array) -> list[Notice]:
    """Return a notice if the image is almost black or white; parameters as of ``extreme_tone``."""
    tone = extreme_tone(shown, background)
    return [Notice("image-extreme", {"tone": tone})] if tone else []


def extreme_tone(shown: Array, background: Array | None = None) -> str:
    """Return "black" or "white" if almost the whole image (..., 3), uint8 or floats in [0, 1], is; else "".

    Pixels of the colour ``background`` (3,) do not count, unless there are no others.
    """
    pixels = shown.reshape(-1, 3)
    if background is not None and (counted := (pixels != background).any(1)).any():
        pixels = pixels[counted]
    most = 255 if pixels.dtype == np.uint8 else 1
    if not len(pixels):
        return ""
    if np.percentile(pixels.max(1), SPARKS) <= BLACK * most:
        return "black"
    return "white" if np.percentile(pixels.min(1), SPECKS) >= WHITE * most else ""
