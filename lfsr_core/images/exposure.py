"""Whether a picture shows anything: almost black and almost white ones are told apart from the rest."""

from __future__ import annotations

import numpy as np

from lfsr_core.arrays import Array

BLACK, WHITE = 8.5 / 255, 249.5 / 255  # display values
# Percentiles of the pixels that say so: sparks in the dark and specks on white do not make a picture.
SPARKS, SPECKS = 99.5, 5.0
REMEDIES = {"black": "make lights or exposure stronger", "white": "make lights or exposure weaker"}


def exposure_notes(shown: Array, background: Array) -> list[str]:
    """For a report: one if the picture is almost black or almost white; arguments as of ``extreme_tone``."""
    tone = extreme_tone(shown, background)
    return [f"the picture is almost {tone}: {REMEDIES[tone]}, or check where the camera looks"] if tone else []


def extreme_tone(shown: Array, background: Array | None = None) -> str:
    """"black" or "white" where the picture is almost that, else "".

    Parameters
    ----------
    shown : (..., 3) display values, uint8 or floats in [0, 1]
    background : (3,) of the same type, pixels that do not count; where there are no others it is the picture
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
