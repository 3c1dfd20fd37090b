"""The names under which a scene is shown. Apart from ``view_transform``: the add-on registers without OpenColorIO."""

from __future__ import annotations

import dataclasses

from lfsr_core.errors import LfsrError

MOST_STOPS, MOST_GAMMA = 100, 100


@dataclasses.dataclass(frozen=True)
class ColorSettings:
    """How Blender would show the scene: names of its OpenColorIO configuration."""

    display_device: str = "sRGB"  # the screen that the values are for
    view_transform: str = "Standard"  # how scene-linear light becomes values of that screen
    look: str = "None"  # an artistic change on the way; "None" or "" for none
    exposure: float = 0.0  # in stops
    gamma: float = 1.0  # exponent of the values is 1 / gamma
    config: str = ""  # path of the configuration of the Blender that rendered, a hint only

    def __post_init__(self) -> None:
        if not (abs(self.exposure) <= MOST_STOPS and 0 <= self.gamma <= MOST_GAMMA):
            raise LfsrError(f"exposure is {self.exposure!r} and gamma {self.gamma!r}, but they must be between "
                            f"-{MOST_STOPS} and {MOST_STOPS} stops, and 0 and {MOST_GAMMA}")
