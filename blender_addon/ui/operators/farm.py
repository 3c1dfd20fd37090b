"""Button that writes a job for a render farm."""

from __future__ import annotations

import bpy

from ...jobs import session, submission
from .base import Result, reports_errors

FARM_ITEMS = [("openjd", "OpenJD", "Request bundle of Open Request Description, for AWS Deadline Cloud and others"),
              ("flamenco", "Flamenco", "Request type and job for a Flamenco 3 manager")]


class LFSR_OT_submit(bpy.types.Operator):
    """Write a job that renders the timeline's range on a render farm, into a folder that its machines can see"""

    bl_idname = "lfsr.submit"
    bl_label = "Write Farm Request"

    farm: bpy.props.EnumProperty(name="Farm", description="Render farm that the job is for", items=FARM_ITEMS)
    directory: bpy.props.StringProperty(
        name="Folder", description="Folder for the job's files; every machine must see it under the same path",
        subtype="DIR_PATH", options={"SKIP_SAVE", "PATH_SUPPORTS_BLEND_RELATIVE"})
    parts: bpy.props.IntProperty(
        name="Parts", description="Number of parts, by rows of lenses, of each frame", min=1, soft_max=64,
        default=1)
    filter_folder: bpy.props.BoolProperty(
        name="Folders", description="Show folders only", default=True, options={"HIDDEN"})

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the tooltip of each farm."""
        return dict((name, text) for name, _, text in FARM_ITEMS)[properties.farm]

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        """Ask for the folder and the parts."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Write the files and show the next command."""
        folder = submission.chosen_folder(self.directory)
        written = submission.submit(context.scene, self.farm, folder, self.parts)
        context.window_manager.clipboard = written.command
        print(f"Light Field: the job is in {folder}. Next (in the clipboard): {written.command}")
        session.tell(f"The job is in the folder {folder.name}, and its next command in the clipboard. {written.note}",
                     "INFO")
        return {"FINISHED"}


class LFSR_MT_submit(bpy.types.Menu):
    """Render farms that can render the timeline's range"""

    bl_label = "Submit"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw one entry per farm."""
        for name, title, _ in FARM_ITEMS:
            self.layout.operator("lfsr.submit", text=f"{title}…").farm = name


CLASSES = (LFSR_OT_submit, LFSR_MT_submit)
