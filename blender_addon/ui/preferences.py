"""The add-on's preferences: the cores that stay free, what runs and denoises in the second stage, and a test of it."""

from __future__ import annotations

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.process.child import output_of

from ..jobs import denoiser, runtime
from .drawing import columns
from .operators.base import Result, reports_errors

SECONDS_FOR_TEST = 120


class LfsrPreferences(bpy.types.AddonPreferences):
    """Settings for all files"""

    bl_idname = runtime.PACKAGE

    python_path: bpy.props.StringProperty(
        name="Second Stage Python", subtype="FILE_PATH",
        description="Python executable that denoises and upscales; empty for Blender's own Python with the packages "
                    "of this add-on")

    oidn_path: bpy.props.StringProperty(
        name="Open Image Denoise", subtype="FILE_PATH",
        description="Library that denoises, such as libOpenImageDenoise.so.2 of a download from openimagedenoise.org; "
                    "empty for Blender's own")

    free_cores: bpy.props.IntProperty(
        name="Free Cores", default=1, min=0, soft_max=8,
        description="Processor cores that renders and the second stage leave to Blender and other programs")

    without_denoiser: bpy.props.BoolProperty(
        name="Render Without Denoiser",
        description="Give new scenes a method that a Blender without Open Image Denoise can run, instead of asking; "
                    "the answer to that question sets it")

    seconds_per_path: bpy.props.FloatProperty(
        name="Time per Path", default=0.0, min=0.0, precision=8, options={"HIDDEN"},
        description="Seconds of a path sample on this machine, measured with the last image; 0 before the first")

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the cores, the library and what is done without it, and the path with its button."""
        column = columns(self.layout)
        column.prop(self, "free_cores")
        column.prop(self, "oidn_path")
        column.prop(self, "without_denoiser")
        column.prop(self, "python_path")
        column.operator(LFSR_OT_test_python.bl_idname, text="Test", icon="CHECKMARK")


class LFSR_OT_test_python(bpy.types.Operator):
    """Start the Python that runs the second stage and report its version and packages"""

    bl_idname = "lfsr.test_python"
    bl_label = "Test Second Stage Python"
    bl_options = {"REGISTER", "INTERNAL"}

    @reports_errors
    def execute(self, _context: bpy.types.Context) -> Result:
        """Report versions, or the reason why it does not work."""
        denoiser.forget()
        self.report({"INFO"}, probe())
        return {"FINISHED"}


def probe() -> str:
    """Versions of the second stage's Python and packages, in one line; LfsrError if it cannot run the second stage."""
    command = runtime.second_stage_command("lfsr_core.tasks.probe")
    try:
        code, output = output_of(command, runtime.environment(), SECONDS_FOR_TEST)
    except OSError as error:
        raise LfsrError(f"Python {command[0]!r} cannot be started ({error}): choose another") from None
    lines = [line for line in output.splitlines() if line.strip()] or ["no reason given"]
    if code != 0:
        raise LfsrError(f"Python {command[0]!r} cannot run the second stage ({lines[-1].strip()}): choose another, or "
                        "clear the preference")
    return lines[-1].strip()


CLASSES = (LFSR_OT_test_python, LfsrPreferences)
