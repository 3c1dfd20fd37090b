"""Button that measures how long an image will take."""

from __future__ import annotations

import bpy

from lfsr_core.base.records import from_data
from lfsr_core.tasks.estimate import Measured

from ...jobs import asked
from ...jobs.task import Job
from .base import TaskOperator, add_missing_array


class LFSR_OT_estimate_time(TaskOperator, bpy.types.Operator):
    """Render a few lenses in the background and tell how long the whole image will take"""

    bl_idname = "lfsr.estimate_time"
    bl_label = "Estimate Time"

    def prepare(self, context: bpy.types.Context) -> Job:
        """Measure the current frame."""
        scene = context.scene
        add_missing_array(scene)
        name = scene.name_full
        return Job("estimate", {"request": asked.asked(scene)[0]},
                   lambda result: asked.remember(name, from_data(Measured, result, "what was measured")))


CLASSES = (LFSR_OT_estimate_time,)
