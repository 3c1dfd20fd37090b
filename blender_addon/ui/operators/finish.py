"""Button that finishes a frame whose render was kept when the second stage failed."""

from __future__ import annotations

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import read_rendered
from lfsr_core.reconstruct.methods import AS_RENDERED, MENU, MORE, SUBPIXEL_METHODS, MethodName

from ...jobs import asked, denoiser
from ...jobs.task import Job
from ...scene import folders
from ...scene.settings import title
from .base import TaskOperator
from .render import show_image_of

Items = list[tuple[str, str, str]]
_shown: Items = []  # Blender keeps no copy of the texts of a menu


def _items(_operator: bpy.types.Operator, context: bpy.types.Context | None) -> Items:
    """Methods that can finish the current frame with what this Blender has."""
    names = methods(context.scene) if context else (*MENU, *MORE)
    _shown[:] = [(name, title(name), (MENU | MORE)[name][1]) for name in names]
    return _shown


def methods(scene: bpy.types.Scene) -> list[str]:
    """Names of the methods that can finish the current frame of ``scene``."""
    try:
        frame, lacks = read_rendered(folders.frame_folder(scene)), bool(denoiser.why_missing())
    except LfsrError:
        return []
    known = [MethodName.parse(name) for name in (*MENU, *MORE)]
    if frame.subpixels:
        fits = [name for name in known if name.text in SUBPIXEL_METHODS]
    else:
        fits = [name for name in known if (name.upscaler == AS_RENDERED) == (frame.scale == 1)]
    return [name.text for name in fits if not (lacks and name.needs_denoiser)]


class LFSR_OT_finish_frame(TaskOperator, bpy.types.Operator):
    """Make the image of the current frame from its render, which was kept when the second stage failed"""

    bl_idname = "lfsr.finish_frame"
    bl_label = "Finish Frame"

    method: bpy.props.EnumProperty(name="Method", description="How the image is made", items=_items)

    def prepare(self, context: bpy.types.Context) -> Job:
        """Run the second stage, then show the image; the method becomes the scene's."""
        scene = context.scene
        folder = folders.frame_folder(scene)
        if not folders.is_own(scene, folder) or not folders.is_unfinished(folder):
            raise LfsrError(f"there is no unfinished render in {folder}: render the EIA")
        scene.lfsr.method = self.method
        name, finish = scene.name_full, Finish(self.method, linear_exr=scene.lfsr.linear_exr)
        return Job("finish", {"folder": str(folder), "finish": finish, "views": str(asked.views_file(folder))},
                   lambda _: show_image_of(name, folder), output=folder)


CLASSES = (LFSR_OT_finish_frame,)
