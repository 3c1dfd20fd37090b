"""Buttons of the scene check: run it, select an object, fix a problem."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from lfsr_core.errors import LfsrError

from . import array_edit, array_rig, scene_check, scene_io, session, settings
from .operators import Result, reports_errors
from .rig_operators import UNDO, activate


class LFSR_OT_check_scene(bpy.types.Operator):
    """List what will go wrong with this scene on this display"""

    bl_idname = "lfsr.check_scene"
    bl_label = "Check Scene"

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Fill the list."""
        problems = refresh(context.scene)
        serious = [problem for problem in problems if problem.severity != scene_check.INFO]
        if not problems:
            self.report({"INFO"}, "No problems found")
        elif serious:
            self.report({"WARNING"}, f"{len(serious)} problems found, first {serious[0].target}: {serious[0].reason}")
        else:
            self.report({"INFO"}, f"No problems found, {len(problems)} settings are ignored")
        return {"FINISHED"}


class LFSR_OT_check_select(bpy.types.Operator):
    """Select the object"""

    bl_idname = "lfsr.check_select"
    bl_label = "Select Object with Problem"
    bl_options = UNDO

    target: bpy.props.StringProperty(name="Name", description="Object to select")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Select it and nothing else."""
        activate(context, _object(self.target))
        return {"FINISHED"}


class LFSR_OT_check_fix(bpy.types.Operator):
    """Fix the problem"""

    bl_idname = "lfsr.check_fix"
    bl_label = "Fix Problem"
    bl_options = UNDO

    code: bpy.props.StringProperty(name="Code", description="Kind of problem")
    target: bpy.props.StringProperty(name="Name", description="What has the problem")

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Fix it and check again."""
        if self.code not in FIXES:
            raise LfsrError(f"problem {self.code!r} cannot be fixed by a button: choose one of {', '.join(FIXES)}")
        if self.code not in OUTSIDE_SCENE:
            _check_editable(context.scene)
        FIXES[self.code](context.scene, self.target)
        refresh(context.scene)
        return {"FINISHED"}


def refresh(scene: bpy.types.Scene) -> list[scene_check.Problem]:
    """Check ``scene`` and put what was found into the list."""
    state, problems = bpy.context.window_manager.lfsr, scene_check.check_scene(scene)
    state.checked_scene = scene.name
    state.problems.clear()
    for problem in problems:
        line = state.problems.add()
        for name in ("code", "target", "reason", "fix", "severity", "is_object"):
            setattr(line, name, getattr(problem, name))
    session.redraw()
    return problems


def _object(name: str) -> bpy.types.Object:
    item = bpy.data.objects.get(name)
    if item is None:
        raise LfsrError(f"object {name!r} is not there any more: check the scene again")
    return item


def _check_editable(data: bpy.types.ID) -> None:
    reason = array_rig.why_not_editable(data)
    if reason:
        raise LfsrError(reason)


def _enable_cycles(_scene: bpy.types.Scene, _target: str) -> None:
    bpy.ops.preferences.addon_enable(module="cycles")


def _use_cycles(scene: bpy.types.Scene, _target: str) -> None:
    scene.render.engine = "CYCLES"


def _add_array(scene: bpy.types.Scene, _target: str) -> None:
    array_edit.add(scene, settings.display_of(scene))


def _add_light(scene: bpy.types.Scene, _target: str) -> None:
    scene_io.add_light(scene).name = "Light Field World"


def _use_cpu(scene: bpy.types.Scene, _target: str) -> None:
    scene.cycles.device = "CPU"


def _use_osl(scene: bpy.types.Scene, _target: str) -> None:
    scene.cycles.device, scene.cycles.shading_system = "CPU", True


def _pack(_scene: bpy.types.Scene, target: str) -> None:
    image = bpy.data.images.get(target)
    if image is None:
        raise LfsrError(f"image {target!r} is not there any more: check the scene again")
    image.pack()


def _to_background(scene: bpy.types.Scene, target: str) -> None:
    item = _object(target)
    background = bpy.data.collections.get(scene_io.BACKGROUND_COLLECTION)
    if background is None:
        background = bpy.data.collections.new(scene_io.BACKGROUND_COLLECTION)
    _check_editable(background)
    if background not in scene.collection.children_recursive:
        scene.collection.children.link(background)
    if item.name not in background.objects:
        background.objects.link(item)
    for collection in item.users_collection:
        if collection != background and collection.library is None:
            collection.objects.unlink(item)


def _box_filter(scene: bpy.types.Scene, _target: str) -> None:
    scene.cycles.pixel_filter_type = "BOX"


def _no_denoiser(scene: bpy.types.Scene, _target: str) -> None:
    scene.cycles.use_denoising = False


def _no_motion_blur(scene: bpy.types.Scene, _target: str) -> None:
    scene.render.use_motion_blur = False


def _no_focus(_scene: bpy.types.Scene, target: str) -> None:
    camera = _object(target).data
    _check_editable(camera)
    camera.dof.use_dof = False


FIXES: dict[str, Callable[[bpy.types.Scene, str], None]] = {
    "cycles": _enable_cycles, "engine": _use_cycles, "array": _add_array, "light": _add_light, "device": _use_cpu,
    "script": _use_osl, "dirty": _pack, "background": _to_background, "filter": _box_filter,
    "denoiser": _no_denoiser, "motion": _no_motion_blur, "focus": _no_focus}
OUTSIDE_SCENE = ("cycles", "dirty", "focus")

CLASSES = (LFSR_OT_check_scene, LFSR_OT_check_select, LFSR_OT_check_fix)
