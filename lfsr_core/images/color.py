"""The sRGB curve, by which metrics compare images whatever their view transform, and Blender's colour settings."""

from __future__ import annotations

import dataclasses

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError

MAX_STOPS, MAX_GAMMA = 100, 100


def srgb_encode(linear: Array) -> Array:
    """Encode linear values, clipped to [0, 1], by the sRGB curve (IEC 61966-2-1); any shape."""
    clipped = np.clip(linear, 0, 1)
    return np.where(clipped <= 0.0031308, clipped * 12.92, 1.055 * clipped ** (1 / 2.4) - 0.055).astype(clipped.dtype)


def srgb_decode(encoded: Array) -> Array:
    """Decode sRGB values in [0, 1] to linear light; any shape."""
    values = np.clip(encoded, 0, 1)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(values.dtype)


@dataclasses.dataclass(frozen=True)
class ColorSettings:
    """How Blender shows a scene: names from its OpenColorIO configuration."""

    display_device: str = "sRGB"  # the screen
    view_transform: str = "Standard"  # from scene-linear light to values of that screen
    look: str = "None"  # an artistic change before it; "None" or "" for none
    exposure: float = 0.0  # in stops
    gamma: float = 1.0  # exponent of the values is 1 / gamma
    config: str = ""  # path of the configuration of the Blender that rendered, if it still exists

    def __post_init__(self) -> None:
        if not (abs(self.exposure) <= MAX_STOPS and 0 <= self.gamma <= MAX_GAMMA):
            raise LfsrError(f"exposure is {self.exposure!r} and gamma {self.gamma!r}, but they must be between "
                            f"-{MAX_STOPS} and {MAX_STOPS} stops, and 0 and {MAX_GAMMA}")
