"""Button that writes a job for a render farm."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, system_errors
from lfsr_core.frames.folder import FARM_COPY
from lfsr_core.pipeline.farms import write_job

from ...jobs import asked, images, session
from ...jobs.task import save_copy
from ...scene import folders
from ...scene import settings as scene_settings
from ...scene.array.placement import scale_of
from ...scene.settings import PROFILE_FILE
from .base import AsksForFile, Result, reports_errors

COPY_SUFFIX = f"{FARM_COPY}.blend"  # never the name of a file that somebody works on

FARM_ITEMS = [("openjd", "OpenJD", "Request bundle of Open Request Description, for AWS Deadline Cloud and others"),
              ("flamenco", "Flamenco", "Request type and job for a Flamenco 3 manager")]


class LFSR_OT_submit(AsksForFile, bpy.types.Operator):
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

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Write the files and show the next command."""
        if not self.directory.strip():
            raise LfsrError("no folder is chosen for the farm's job: give one that every machine of the farm can see")
        folder = folders.absolute(self.directory, "the folder of the job")
        command, note = submit(context.scene, self.farm, folder, self.parts)
        context.window_manager.clipboard = command
        print(f"Light Field: the job is in {folder}. Next (in the clipboard): {command}")
        session.tell(f"The job is in the folder {folder.name}, and its next command in the clipboard. {note}",
                     "INFO")
        return {"FINISHED"}


def submit(scene: bpy.types.Scene, farm: str, folder: Path, parts: int) -> tuple[str, str]:
    """Write the job of the timeline's range for ``farm``, "openjd" or "flamenco", with ``parts`` parts per frame.

    A copy of the file, the farm's template and the panel's settings go into ``folder``, which is created where it is
    missing; every machine of the farm must see it under the same path. LfsrError where the scene cannot be rendered or
    the folder cannot be written to.
    """
    scene_settings.resolve(scene).check_light_field("a farm's job")
    request, finish, frames = asked.asked_animation(scene)
    if request.sampling.scales:
        with images.wait_cursor():
            request = request.with_scale(scale_of(scene, request))
    with system_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    display = ""
    if scene.lfsr.display == PROFILE_FILE:
        path = folders.absolute(scene.lfsr.profile_file, "the display profile")
        display = str(folder / path.name)
        if path.resolve() != Path(display).resolve():
            with atomic_path(display) as temporary:
                shutil.copyfile(path, temporary)
    copy = folder / f"{folders.file_stem()}{COPY_SUFFIX}"
    with atomic_path(copy) as temporary:
        save_copy(temporary)
    request = dataclasses.replace(request, scene=str(copy))
    return write_job(farm, folder, request, finish, frames, parts, display)


class LFSR_MT_submit(bpy.types.Menu):
    """Render farms that can render the timeline's range"""

    bl_label = "Submit"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw one entry per farm."""
        for name, title, _ in FARM_ITEMS:
            self.layout.operator("lfsr.submit", text=f"{title}…").farm = name


CLASSES = (LFSR_OT_submit, LFSR_MT_submit)
