"""Buttons that show or export a finished frame, calibrate its display, and show the light field live."""

import functools
import os
import subprocess
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.calibration.patterns import pattern
from lfsr_core.commands.sentences import sentence
from lfsr_core.exports.options import FILMS, FORMATS, QUILT_FILM, default_target
from lfsr_core.frames.folder import FrameFolder, frame_folders
from lfsr_core.process.child import OPENS, START

from ... import compat
from ...jobs import folders, images, runtime, session
from ...jobs.session import Job
from ...live import session as live
from ...live.scene import EYE, PANEL
from ...scene import settings as scene_settings
from ...scene.settings import PROFILE_FILE
from .base import AsksForFile, DescribedByItem, Result, TaskOperator, add_missing_array, reports_errors

PURPOSE = "to show or export"
LIVE_ITEMS = [(PANEL, "Live", "Open or close a window for the display, which shows the light field as it renders"),
              (EYE, "One Eye", "Open or close a window that shows what an eye in front of the display sees")]
FORMAT_ITEMS = [(name, one.title, one.text[0].upper() + one.text[1:]) for name, one in FORMATS.items()]


class LFSR_OT_open_viewer(TaskOperator, bpy.types.Operator):
    """Show the current frame's image in the browser, as an eye in front of the display sees it"""

    bl_idname = "lfsr.open_viewer"
    bl_label = "Open Viewer"

    def prepare(self, context: bpy.types.Context) -> Job:
        folder = folders.finished_frame(context.scene, PURPOSE)
        return Job("view", {"folder": str(folder)}, lambda result: _open(Path(result["path"])))


class LFSR_OT_export(DescribedByItem, TaskOperator, bpy.types.Operator):
    """Export the current frame's image for other displays and programs, into its folder"""

    bl_idname = "lfsr.export"
    bl_label = "Export Light Field"
    item = "format"

    format: bpy.props.EnumProperty(name="Format", description="Format of the export", items=FORMAT_ITEMS)

    def prepare(self, context: bpy.types.Context) -> Job:
        folder = folders.finished_frame(context.scene, PURPOSE)
        if self.format == QUILT_FILM:
            folder = folder.parent
            if len(frame_folders(folder)) < 2:
                raise LfsrError(f"there is one image only in {folder}, expected an animation: press Render Animation")
        target = default_target(folder, self.format)

        def say_where(_result: dict[str, str]) -> None:
            bpy.context.window_manager.lfsr.outcome_folder = str(target)
            print(f"Light Field: exported to {target}")

        fps = None if self.format in FILMS else context.scene.render.fps / context.scene.render.fps_base
        return Job("export", {"folder": str(folder), "name": self.format, "target": str(target), "fps": fps}, say_where)


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
        name = next((name for name in ("animation", "full_screen") if getattr(properties, name)), None)
        return properties.bl_rna.properties[name].description if name else ""

    def prepare(self, context: bpy.types.Context) -> Job:
        folder, display = folders.shown_frame(context.scene, "to show"), scene_settings.display_of(context.scene)
        render = context.scene.render
        made = FrameFolder(folder).rendered.display
        if (made.name, made.views, made.panel_pixels) != (display.name, display.views, display.panel_pixels):
            raise LfsrError(f"the image in {folder} is for the display {made.title or made.name}, but the scene's is "
                            f"{display.title or display.name}: choose that one, or render the EIA again")

        def say_what_is_shown(shown: dict[str, str]) -> None:
            session.say(shown["sentence"])
            if shown["page"]:
                _open(Path(shown["page"]))

        return Job("show", {"path": str(folder.parent if self.animation else folder), "full_screen": self.full_screen,
                            "fps": render.fps / render.fps_base}, say_what_is_shown)


class LFSR_MT_export(bpy.types.Menu):
    """Formats to export the current frame's image in"""

    bl_label = "Export"

    def draw(self, _context: bpy.types.Context) -> None:
        for name, title, _ in FORMAT_ITEMS:
            self.layout.operator("lfsr.export", text=title).format = name


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
        from lfsr_core.images.image_files import write_png  # needs OpenImageIO, which the panel does without

        path = Path(bpy.path.abspath(self.filepath)).with_suffix(".png")
        write_png(path, pattern(scene_settings.display_of(context.scene), "phase"))
        session.tell(f"Show {path.name} on the display at full size, and photograph it in a dark room.", "INFO")
        return {"FINISHED"}


class LFSR_OT_calibrate(AsksForFile, bpy.types.Operator):
    """Measure the lenses of this very display by photographs of the test picture, taken from one place"""

    bl_idname = "lfsr.calibrate"
    bl_label = "Calibrate from Photographs"

    files: bpy.props.CollectionProperty(name="Photographs", description="Photographs of the test picture",
        type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
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
        with compat.wait_cursor():
            _, notices = calibrate(profile, photos, [tuple(self.place)] * len(photos), output)
        lfsr = context.scene.lfsr
        lfsr.display, lfsr.profile_file = PROFILE_FILE, str(output)
        images.open_file(output.with_suffix(".png"), opens_window=True)
        lines = [sentence(notice) for notice in notices]
        print("\n".join(f"Light Field: {line}" for line in lines))
        session.tell(f"The display is now {output.name}: {lines[0]}. Photographs as taken are on the left, as "
                     "predicted on the right.", "INFO")
        return {"FINISHED"}


class LFSR_OT_live(DescribedByItem, bpy.types.Operator):
    """Open or close a live window"""

    bl_idname, bl_label, item = "lfsr.live", "Live Window", "kind"

    kind: bpy.props.EnumProperty(name="Kind", description="What the window shows", items=LIVE_ITEMS)

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        """Open it, to follow the scene and its settings, or close it. A scene without a camera array gets one."""
        if live.is_on(self.kind):
            live.stop(self.kind)
        else:
            add_missing_array(context.scene)
            live.start(context.scene, self.kind)
        return {"FINISHED"}


class LFSR_OT_live_full_screen(bpy.types.Operator):
    """Make the live window full screen, or a window again"""

    bl_idname, bl_label = "lfsr.live_full_screen", "Full Screen"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        """Only while there is a live window: Blender's own would change otherwise."""
        return live.is_on()

    def execute(self, _context: bpy.types.Context) -> Result:
        """Toggle it: Blender's default keys have no shortcut for that."""
        with bpy.context.temp_override(window=live.find_window(PANEL)):
            bpy.ops.wm.window_fullscreen_toggle()
        return {"FINISHED"}


def _open(page: Path) -> None:
    print(f"Light Field: {page}")
    bpy.context.window_manager.lfsr.outcome_folder = str(page.parent)
    if not bpy.app.background:
        bpy.app.timers.register(functools.partial(_look, _browser(page), page), persistent=True)


def _browser(page: Path) -> subprocess.Popen[bytes]:
    """Open a page in a browser with a window, from a process of its own: Python would wait until some browsers end."""
    return subprocess.Popen(runtime.second_stage_command("-c", OPENS, page.as_uri()), stdin=subprocess.DEVNULL,
                            env={**os.environ, "TERM": ""}, **START)


def _look(process: subprocess.Popen[bytes], page: Path) -> float | None:
    """Timer: say where the page is if no browser has opened it."""
    is_running = process.poll() is None
    if process.returncode:
        session.say(f"no browser has opened {page.name}, which lies in the folder {page.parent.name}: open it in one")
        session.redraw()
    return session.SECONDS_BETWEEN_LOOKS if is_running else None


CLASSES = (LFSR_OT_open_viewer, LFSR_OT_export, LFSR_OT_show, LFSR_MT_export, LFSR_OT_test_picture, LFSR_OT_calibrate,
           LFSR_OT_live, LFSR_OT_live_full_screen)
