"""Buttons that show a finished frame in a browser, or export it."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.exports.options import FILMS, FORMATS, QUILT_FILM, default_target
from lfsr_core.frames.folder import FrameFolder, frame_folders

from ...jobs import session
from ...jobs.task import Job
from ...scene import folders
from ...scene import settings as scene_settings
from .base import TaskOperator

# What opens pages on Linux. Windows and macOS have a browser.
BROWSERS = ("xdg-open", "gio", "firefox", "chromium", "google-chrome", "brave-browser", "epiphany")
PURPOSE = "to show or export"
FORMAT_ITEMS = [(name, one.title, one.text[0].upper() + one.text[1:]) for name, one in FORMATS.items()]


class LFSR_OT_open_viewer(TaskOperator, bpy.types.Operator):
    """Show the current frame's image in the browser, as an eye in front of the display sees it"""

    bl_idname = "lfsr.open_viewer"
    bl_label = "Open Viewer"

    def prepare(self, context: bpy.types.Context) -> Job:
        """Write the page, then open it."""
        folder = folders.finished_frame(context.scene, PURPOSE)
        return Job("view", {"folder": str(folder)}, lambda result: _open(Path(result["path"])))


class LFSR_OT_export(TaskOperator, bpy.types.Operator):
    """Export the current frame's image for other displays and programs, into its folder"""

    bl_idname = "lfsr.export"
    bl_label = "Export Light Field"

    format: bpy.props.EnumProperty(name="Format", description="Format of the export", items=FORMAT_ITEMS)

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the tooltip of each format."""
        return dict((name, text) for name, _, text in FORMAT_ITEMS)[properties.format]

    def prepare(self, context: bpy.types.Context) -> Job:
        """Export, then show where the files are."""
        folder = folders.finished_frame(context.scene, PURPOSE)
        if self.format == QUILT_FILM:
            folder = folder.parent
            if len(frame_folders(folder)) < 2:
                raise LfsrError(f"there is one image only in {folder}, expected an animation: press Render Animation")
        target = default_target(folder, self.format)
        fps = None if self.format in FILMS else _rate(context)
        return Job("export", {"folder": str(folder), "name": self.format, "target": str(target), "fps": fps},
                   lambda _: _say_where(target))


class LFSR_OT_show(TaskOperator, bpy.types.Operator):
    """Show the current frame on its display: lenticular ones through Looking Glass Bridge, others in the browser"""

    bl_idname = "lfsr.show"
    bl_label = "Show on Display"

    full_screen: bpy.props.BoolProperty(
        name="Full Screen", description="Show the panel's own image, full screen in the browser", options={"SKIP_SAVE"})
    animation: bpy.props.BoolProperty(
        name="Animation", description="Show all finished frames on their display, over and over", options={"SKIP_SAVE"})

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the tooltip of each button."""
        switches = (name for name in ("animation", "full_screen") if getattr(properties, name))
        name = next(switches, None)
        return cls.bl_rna.properties[name].description if name else ""

    def prepare(self, context: bpy.types.Context) -> Job:
        """Show it, then say where."""
        folder, display = folders.shown_frame(context.scene, "to show"), scene_settings.display_of(context.scene)
        made = FrameFolder(folder).rendered.display
        if (made.name, made.views, made.panel_pixels) != (display.name, display.views, display.panel_pixels):
            raise LfsrError(f"the image in {folder} is for the display {made.title or made.name}, but the scene's is "
                            f"{display.title or display.name}: choose that one, or render the EIA again")
        return Job("show", {"path": str(folder.parent if self.animation else folder), "full_screen": self.full_screen,
                            "fps": _rate(context)}, _say_what_is_shown)


class LFSR_MT_export(bpy.types.Menu):
    """Formats to export the current frame's image in"""

    bl_label = "Export"

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw one entry per format."""
        for name, title, _ in FORMAT_ITEMS:
            self.layout.operator("lfsr.export", text=title).format = name


def _rate(context: bpy.types.Context) -> float:
    """Frames a second of the scene."""
    rate: float = context.scene.render.fps / context.scene.render.fps_base
    return rate


def _say_where(target: Path) -> None:
    bpy.context.window_manager.lfsr.outcome_folder = str(target)
    print(f"Light Field: exported to {target}")


def _say_what_is_shown(shown: dict[str, str]) -> None:
    session.say(shown["sentence"])
    if shown["page"]:
        _open(Path(shown["page"]))


def _open(page: Path) -> None:
    print(f"Light Field: {page}")
    # $BROWSER is a list of commands, each with arguments, as for Python's webbrowser.
    chosen = filter(None, map(shlex.split, os.environ.get("BROWSER", "").split(os.pathsep)))
    names = (*(command[0] for command in chosen), *BROWSERS)
    if sys.platform not in {"win32", "darwin"} and not any(map(shutil.which, names)):
        session.say(f"there is no browser here: open {page.name}, which lies in the folder {page.parent.name}, in one")
        bpy.context.window_manager.lfsr.outcome_folder = str(page.parent)
        return
    if not bpy.app.background:
        bpy.ops.wm.url_open(url=page.as_uri())


CLASSES = (LFSR_OT_open_viewer, LFSR_OT_export, LFSR_OT_show, LFSR_MT_export)
