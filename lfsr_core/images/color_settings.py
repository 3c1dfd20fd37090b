"""The names under which a scene is shown. Apart from ``view_transform``: the add-on registers without OpenColorIO."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class ColorSettings:
    """How Blender would show the scene: names of its OpenColorIO configuration.

    ``exposure`` is in stops; ``config`` is the path of the configuration of the
    Blender that rendered, a hint only.
    """

    display_device: str = "sRGB"
    view_transform: str = "Standard"
    look: str = "None"
    exposure: float = 0.0
    gamma: float = 1.0
    config: str = ""
