"""The add-on's preferences: a Python of the user's for the second stage, and a test of it."""

from __future__ import annotations

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.render.child import output_of

from ..background.runtime import PACKAGE

SECONDS_FOR_TEST = 120


class LfsrPreferences(bpy.types.AddonPreferences):
    """Choices that hold for every file."""

    bl_idname = PACKAGE

    python_path: bpy.props.StringProperty(
        name="Python with PyTorch", subtype="FILE_PATH",
        description="Python executable that runs the second stage, such as one of an environment with PyTorch and a "
                    "GPU; empty: Blender's own Python with what this add-on brings")

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the path with its button."""
        row = self.layout.row(align=True)
        row.prop(self, "python_path")
        row.operator(LFSR_OT_test_python.bl_idname, text="Test", icon="CHECKMARK")


class LFSR_OT_test_python(bpy.types.Operator):
    """Start the Python that runs the second stage and report what it has"""

    bl_idname = "lfsr.test_python"
    bl_label = "Test Second Stage's Python"
    bl_options = {"REGISTER", "INTERNAL"}

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Report versions, engines and devices, or the reason why it will not work."""
        try:
            self.report({"INFO"}, probe())
        except LfsrError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


def probe() -> str:
    """One sentence on the second stage's Python: version, engines, device; LfsrError if it cannot run it."""
    from ..background import runtime

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
