"""What the panel knows in this session: found problems, messages, results of the last tasks."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty


class FoundProblem(bpy.types.PropertyGroup):
    """One row of the scene check: problems of one kind."""

    code: StringProperty(name="Code", description="Kind of problem")
    target: StringProperty(name="Name", description="What has the problem")
    reason: StringProperty(name="Reason", description="What will go wrong")
    fix: StringProperty(name="Fix", description="What the fix button does")
    severity: EnumProperty(
        name="Severity", description="How bad it is",
        items=[("ERROR", "Error", "The image will be wrong or missing"),
               ("WARNING", "Warning", "Part of the image will look bad"),
               ("INFO", "Information", "Light-field renders ignore it")])
    is_object: BoolProperty(name="Object", description="The problem is that of an object in the scene")
    title: StringProperty(name="Title", description="What has the problem, or how many things have it")
    count: IntProperty(name="Count", description="Number of things that have the problem", default=1)
    expanded: BoolProperty(name="Show Names", description="Show what has the problem", default=False)


class SessionState(bpy.types.PropertyGroup):
    """State of the panel in this session."""

    problems: CollectionProperty(
        name="Problems", description="What the last scene check found", type=FoundProblem)
    all_problems: BoolProperty(
        name="Show All", description="Also show the problems after the first five", default=False)
    checked_scene: StringProperty(name="Checked Scene", description="Scene that was checked last")
    message: StringProperty(name="Message", description="Why the last render ended, or what it left out")
    message_is_error: BoolProperty(name="Message Is Error", description="The message says what went wrong")
    outcome: StringProperty(name="Outcome", description="What the last task has done, and in which time")
    outcome_folder: StringProperty(name="Outcome Folder", description="Folder that the last task has written to")
    probe_scene: StringProperty(name="Measured Scene", description="Scene whose time was measured last")
    probe_fixed: FloatProperty(name="Fixed Time", description="Seconds before the first sample of an image")
    probe_per_path: FloatProperty(name="Time per Path", description="Seconds of a path sample", precision=6)
    probe_scale: IntProperty(name="Measured Scale", description="Scale at which the time was measured")
    test_shown: StringProperty(name="Test Image", description="Folder and display of the last test image")
    plan_scene: StringProperty(name="Planned Scene", description="Scene that the last plan is for")
    plan_text: StringProperty(name="Plan", description="What the last plan found")
    plan_scale: IntProperty(name="Planned Scale", description="Scale that the last plan found")
    plan_samples: IntProperty(name="Planned Samples", description="Samples that the last plan found")
    plan_method: StringProperty(name="Planned Method", description="Method that the last plan found, if any")
