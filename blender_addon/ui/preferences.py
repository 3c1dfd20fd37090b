"""The add-on's preferences: the cores that stay free, and what denoises."""

from __future__ import annotations

import bpy

from ..jobs import runtime
from .drawing import columns


class LfsrPreferences(bpy.types.AddonPreferences):
    """Settings for all files"""

    bl_idname = runtime.PACKAGE

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
        column = columns(self.layout)
        for name in ("free_cores", "oidn_path", "without_denoiser"):
            column.prop(self, name)


CLASSES = (LfsrPreferences,)
