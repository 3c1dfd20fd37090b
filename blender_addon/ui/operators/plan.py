"""Buttons that measure what an image costs, find the cheapest settings for a scene, and use them."""

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data
from lfsr_core.commands.sentences import sentence
from lfsr_core.plan.options import Choice, Measured, PlanOptions, Rated
from lfsr_core.reconstruct.methods import AS_RENDERED

from ...jobs import folders, session
from ...jobs.session import Job
from ...scene import settings as scene_settings
from ...scene.settings import title
from ...scene.words import counted
from .base import UNDO, Result, TaskOperator, add_missing_array, reports_errors


class LFSR_OT_estimate_time(TaskOperator, bpy.types.Operator):
    """Render a few lenses in the background and tell how long the whole image will take"""

    bl_idname = "lfsr.estimate_time"
    bl_label = "Estimate Time"

    def prepare(self, context: bpy.types.Context) -> Job:
        scene = context.scene
        add_missing_array(scene)
        name = scene.name_full
        return Job("estimate", {"request": folders.requested(scene)[0]},
                   lambda result: folders.remember(name, from_data(Measured, result, "what was measured")))


class LFSR_OT_plan(TaskOperator, bpy.types.Operator):
    """Measure a few lenses of the current frame and find the cheapest settings that reach the target"""

    bl_idname = "lfsr.plan"
    bl_label = "Find Cheapest Settings"

    def prepare(self, context: bpy.types.Context) -> Job:
        scene = context.scene
        scene_settings.resolve(scene).check_light_field("a plan")
        add_missing_array(scene)
        options = PlanOptions(target=round(scene.lfsr.plan_target, 4))  # a float of single precision is not exact
        request, _ = folders.requested(scene)
        state = context.window_manager.lfsr
        state.plan_scene = state.plan_text = state.plan_method = ""  # the last result must not seem to be this one's
        name = scene.name_full
        return Job("plan", {"request": request, "options": options},
                   lambda result: show(options.target, name, from_data(Choice, result, "the plan's result")))


class LFSR_OT_plan_use(bpy.types.Operator):
    """Set the scale, rays per pixel and method that were found"""

    bl_idname = "lfsr.plan_use"
    bl_label = "Use Settings"
    bl_options = UNDO

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        scene, state = context.scene, context.window_manager.lfsr
        if state.plan_scene != scene.name_full or not state.plan_method:
            raise LfsrError(f"no settings were found for scene {scene.name!r}: press Find first")
        pixels = scene_settings.display_of(scene).finished_pixels(state.plan_scale)
        scene.lfsr.scale, scene.lfsr.method = str(state.plan_scale), state.plan_method
        scene.lfsr.rays, scene.lfsr.samples = state.plan_samples / pixels, 0
        return {"FINISHED"}


def show(target: float, scene_name: str, choice: Choice) -> None:
    """Store the result for the panel."""
    goal = f"SSIM {target:g}"
    if choice.chosen is not None:
        text = f"{measured(choice.chosen)} reaches {goal} with 95 % confidence in about {choice.chosen.seconds:.0f} s"
    else:
        best = f" with 95 % confidence; best is {measured(choice.best)}" if choice.best else ""
        limit = f". Limit: {sentence(choice.limit)}" if choice.limit else ""
        text = f"nothing reaches {goal}{best}{limit}"
    state, chosen = bpy.context.window_manager.lfsr, choice.chosen
    state.plan_scene, state.plan_text = scene_name, text
    if chosen is not None:
        state.plan_scale, state.plan_samples, state.plan_method = chosen.scale, chosen.samples, chosen.method
    print(f"Light Field: {text}")
    session.redraw()


def measured(row: Rated) -> str:
    """Return what the panel calls a measured candidate: "scale 4×, 16 samples, Fast (0.961, at least 0.953)"."""
    estimate, method = row.estimate, "no denoiser" if row.method == AS_RENDERED else title(row.method)
    accuracy = f" ({estimate.mean:.3f}, at least {estimate.low:.3f})" if estimate else ""
    return f"scale {row.scale}×, {counted(row.samples, 'sample')}, {method}{accuracy}"


CLASSES = (LFSR_OT_estimate_time, LFSR_OT_plan, LFSR_OT_plan_use)
