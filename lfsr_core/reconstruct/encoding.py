"""The domain in which methods work: scene-linear light encoded near the eye's response."""

from __future__ import annotations

import numpy as np

from lfsr_core.base.arrays import Array

MAX_EXPONENT = 80  # keeps overshoot beside the brightest floats finite


def encode(linear: Array) -> Array:
    """Encode scene-linear values >= 0: √x up to 1, 1 + ½·ln x above.

    Interpolation of encoded highlights does not ring over dark neighbours, and decoding is fast on an 8K image.
    """
    encoded, bright = np.asarray(np.sqrt(np.minimum(linear, 1))), np.greater(linear, 1)
    if bright.any():
        # Highlights are few, so the logarithm is taken of them alone.
        encoded[bright] += np.log(linear[bright]) * np.float32(0.5)
    return encoded


def decode(encoded: Array, out: Array | None = None) -> Array:
    """Decode encoded values, into ``out`` if given; negative overshoot becomes 0."""
    bright = encoded > 1 if encoded.size and encoded.max() > 1 else None
    highlights = np.exp(np.minimum(2 * (encoded[bright] - 1), MAX_EXPONENT)) if bright is not None else None
    linear = np.maximum(encoded, 0, out=out)
    np.multiply(linear, linear, out=linear)
    if bright is not None:
        linear[bright] = highlights
    return linear
