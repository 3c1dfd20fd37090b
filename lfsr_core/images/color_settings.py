"""Settings of Blender's colour management; this module does not need OpenColorIO."""

from __future__ import annotations

import dataclasses

from lfsr_core.base.errors import LfsrError

MAX_STOPS, MAX_GAMMA = 100, 100


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
