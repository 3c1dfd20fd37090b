"""Button that measures how long an image will take."""

from __future__ import annotations

import functools

import bpy

from ...jobs import probe, recipes
from .base import Prepared, TaskOperator, add_missing_array


class LFSR_OT_estimate_time(TaskOperator, bpy.types.Operator):
    """Render a few lenses in the background and tell how long the whole image will take"""

    bl_idname = "lfsr.estimate_time"
    bl_label = "Estimate Time"

    def prepare(self, context: bpy.types.Context) -> Prepared:
        """Measure the current frame."""
        scene = context.scene
        add_missing_array(scene)
        return probe.measure(recipes.frame_recipe(scene).job), functools.partial(probe.remember, scene.name_full)


CLASSES = (LFSR_OT_estimate_time,)
