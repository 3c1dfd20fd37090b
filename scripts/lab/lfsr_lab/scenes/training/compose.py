"""A whole scene: one layout, its light and, now and then, a backdrop, fog or a view from above."""

from __future__ import annotations

import math

from lfsr_lab.scenes.training import hard_layouts, layouts
from lfsr_lab.scenes.training.lights import light_open_scene
from lfsr_lab.scenes.training.stage import Stage

FROM_ABOVE = ("hero", "assembly", "pile", "woods", "bouquet", "meadow", "crowd")
OWN_BACKGROUND = ("wall", "street", "window")


def compose(stage: Stage) -> None:
    """Fill the stage with one random layout and its light; the first note is the layout's."""
    choices = layouts.LAYOUTS | hard_layouts.LAYOUTS
    name = stage.pick({name: weight for name, (weight, _) in choices.items()})
    stage.note("layout", name=name, front=stage.front, behind=stage.behind)
    choices[name][1](stage)
    if name not in ("room", *hard_layouts.LIT):
        light_open_scene(stage)
        if name not in OWN_BACKGROUND and stage.chance(0.15):
            layouts.backdrop(stage)
        elif name in FROM_ABOVE and stage.chance(0.6):
            stage.pitch = stage.rng.uniform(0, math.radians(35))
            stage.note("pitch", angle=stage.pitch)
    if stage.chance(0.07):
        hard_layouts.fog(stage)
