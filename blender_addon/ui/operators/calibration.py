"""Buttons that calibrate a display with a lens sheet: the test picture, and photographs of it."""

from __future__ import annotations

from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.calibration.patterns import pattern
from lfsr_core.commands.sentences import sentence

from ...jobs import images, session
from ...scene import settings as scene_settings
from ...scene.settings import PROFILE_FILE
from .base import AsksForFile, Result, reports_errors


class LFSR_OT_test_picture(AsksForFile, bpy.types.Operator):
    """Write the test picture to show on the display, pixel by pixel, and to photograph"""

    bl_idname = "lfsr.test_picture"
    bl_label = "Save Test Picture"

    filepath: bpy.props.StringProperty(
        name="File", description="PNG file to write", subtype="FILE_PATH", default="phase.png")
    filter_image: bpy.props.BoolProperty(
        name="Images", description="Show images only", default=True, options={"HIDDEN"})

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Write it."""
        from lfsr_core.images.png import write_png  # needs OpenImageIO, which the panel does without

        path = Path(bpy.path.abspath(self.filepath)).with_suffix(".png")
        write_png(path, pattern(scene_settings.display_of(context.scene), "phase"))
        session.tell(f"Show {path.name} on the display at full size, and photograph it in a dark room.", "INFO")
        return {"FINISHED"}


class LFSR_OT_calibrate(AsksForFile, bpy.types.Operator):
    """Measure the lenses of this very display by photographs of the test picture, taken from one place"""

    bl_idname = "lfsr.calibrate"
    bl_label = "Calibrate from Photographs"

    files: bpy.props.CollectionProperty(
        name="Photographs", description="Photographs of the test picture", type=bpy.types.OperatorFileListElement,
        options={"HIDDEN", "SKIP_SAVE"})
    directory: bpy.props.StringProperty(
        name="Folder", description="Folder of the photographs", subtype="DIR_PATH", options={"HIDDEN"})
    filter_image: bpy.props.BoolProperty(
        name="Images", description="Show images only", default=True, options={"HIDDEN"})
    place: bpy.props.FloatVectorProperty(
        name="Camera", description="Place of the camera in millimetres from the middle of the lenses: rightwards, "
        "upwards, towards the viewer", size=3, default=(0.0, 0.0, 500.0))

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Write a profile beside the photographs, choose it and show what it predicts."""
        from lfsr_core.calibration.fit import calibrate  # needs OpenImageIO, too

        photos = [Path(bpy.path.abspath(self.directory)) / file.name for file in self.files if file.name]
        if not photos:
            raise LfsrError("no photograph was chosen: choose one or several of the test picture")
        profile = scene_settings.display_of(context.scene)
        output = photos[0].with_name(f"{profile.name}-calibrated.toml")
        with images.wait_cursor():
            _, notices = calibrate(profile, photos, [tuple(self.place)] * len(photos), output)
        lfsr = context.scene.lfsr
        lfsr.display, lfsr.profile_file = PROFILE_FILE, str(output)
        images.open_file(output.with_suffix(".png"), opens_window=True)
        lines = [sentence(notice) for notice in notices]
        print("\n".join(f"Light Field: {line}" for line in lines))
        session.tell(f"The display is now {output.name}: {lines[0]}. Photographs as taken are on the left, as "
                     "predicted on the right.", "INFO")
        return {"FINISHED"}


CLASSES = (LFSR_OT_test_picture, LFSR_OT_calibrate)
