"""The names under which a scene is shown. Apart from ``view_transform``: the add-on registers without OpenColorIO."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class ColorSettings:
    """How Blender would show the scene: names of its OpenColorIO configuration.

    Attributes
    ----------
    display_device : the screen that the values are for
    view_transform : how scene-linear light becomes values of that screen
    look : an artistic change on the way; "None" or "" for none
    exposure : in stops
    gamma : exponent of the values is 1 / gamma
    config : path of the configuration of the Blender that rendered, a hint only
    """

    display_device: str = "sRGB"
    view_transform: str = "Standard"
    look: str = "None"
    exposure: float = 0.0
    gamma: float = 1.0
    config: str = ""
