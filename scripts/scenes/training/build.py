"""One training scene of one seed and index, built in an empty Blender."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from training import layouts
from training.displays import choose_display
from training.stage import Stage


def empty_blender() -> None:
    """No objects, no render engine in memory, no settings of the user."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def build_scene(seed: int, index: int, attempt: int, display: str, scale: int,
                textures: tuple[Path, ...]) -> Stage:
    """Scene ``index`` of ``seed``: the same whatever was built before it."""
    empty_blender()
    rng = np.random.default_rng([seed, index, attempt])
    stage = Stage.for_display(rng, choose_display(display, rng), scale, textures)
    stage.layout = layouts.build(stage)
    scene = bpy.context.scene
    # The same scene is rendered several times: keep textures and acceleration structure between renders.
    scene.render.use_persistent_data = True
    return stage
