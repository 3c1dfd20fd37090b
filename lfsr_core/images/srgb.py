"""The sRGB curve. Metrics compare images through it, whatever the scene's view transform."""

from __future__ import annotations

import numpy as np

from lfsr_core.base.arrays import Array


def srgb_encode(linear: Array) -> Array:
    """Encode linear values, clipped to [0, 1], by the sRGB curve (IEC 61966-2-1); any shape."""
    clipped = np.clip(linear, 0, 1)
    return np.where(clipped <= 0.0031308, clipped * 12.92, 1.055 * clipped ** (1 / 2.4) - 0.055).astype(clipped.dtype)


def srgb_decode(encoded: Array) -> Array:
    """Decode sRGB values in [0, 1] to linear light; any shape."""
    values = np.clip(encoded, 0, 1)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(values.dtype)
