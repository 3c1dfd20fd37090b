"""Buttons that render, here or on a farm, compare and preview: read the settings, start a task, show its result."""

import dataclasses
import functools
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from lfsr_core.base.messages import LfsrError, Notice, duration
from lfsr_core.base.system import atomic_path, system_errors
from lfsr_core.frames.folder import FARM_COPY, FrameFolder
from lfsr_core.frames.frame import CALM, EIA_FILE, PANEL_FILE, Finish, read_rendered
from lfsr_core.pipeline.farms import write_job
from lfsr_core.reconstruct.methods import AS_RENDERED, MENU, MORE, SUBPIXEL_METHODS, MethodName

from ... import compat
from ...check import look
from ...check.look import MENDS
from ...check.problems import ASKING, MOST_ROWS, Problem, disks, grouped
from ...jobs import folders, images, runtime, session
from ...jobs.runtime import copy_simulations, save_copy
from ...jobs.session import Job
from ...scene import settings as scene_settings
from ...scene.array import edit, rig
from ...scene.array.placement import scale_of
from ...scene.contents import find_subject
from ...scene.settings import PROFILE_FILE, title
from ...scene.words import counted
from .base import AsksForFile, DescribedByItem, Question, Result, TaskOperator, add_missing_array, reports_errors
from .check import FIXES

COPY_SUFFIX = f"{FARM_COPY}.blend"  # never the name of a file that somebody works on
FARM_ITEMS = [("openjd", "OpenJD", "Job bundle of Open Job Description, for AWS Deadline Cloud and others"),
              ("flamenco", "Flamenco", "Job type and job for a Flamenco 3 manager")]
FIRST_VIEW = "A first view from the middle, with few rays. The image follows; cancel if this looks wrong"
LONG = 600.0  # seconds from which the artist is asked before a render
_accepted: set[tuple[str, str, str]] = set()  # what the artist has accepted in this file


class Mends:
    """What a render may change before it starts; its dialog ticks what the scene needs."""

    __annotations__ = {name: bpy.props.BoolProperty(name=title, description=text, options={"SKIP_SAVE"})
                       for name, title, text in MENDS.values()}


class LFSR_OT_render_eia(Mends, TaskOperator, bpy.types.Operator):
    """Render the current frame as the display's elemental image array and open it in the Image Editor"""

    bl_idname = "lfsr.render_eia"
    bl_label = "Render EIA"

    def questions(self, context: bpy.types.Context) -> list[Question]:
        """Ask before another scene's image is overwritten, if the method cannot run, and about what is left out."""
        self.frame = context.scene.frame_current  # the timeline may play while a dialog is open
        return _asked(context.scene, (self.frame,))

    shows_first = False

    def start(self, context: bpy.types.Context) -> Result:
        """Start it with a first view."""
        self.shows_first = True
        return super().start(context)

    def prepare(self, context: bpy.types.Context) -> Job:
        """Render one frame, then show its image. A scene without a camera array gets one."""
        return image_job(context.scene, self.shows_first, self.frame)


class LFSR_OT_render_animation(Mends, TaskOperator, bpy.types.Operator):
    """Render the timeline's frame range; complete frames are not rendered again"""

    bl_idname = "lfsr.render_animation"
    bl_label = "Render Animation"

    def questions(self, context: bpy.types.Context) -> list[Question]:
        """Ask before another scene's frames are overwritten, if the method cannot run, and about what is left out."""
        return _asked(context.scene, folders.timeline(context.scene))

    def prepare(self, context: bpy.types.Context) -> Job:
        """Render the frames that are missing, then show the last image and a summary."""
        return animation_job(context.scene)


class LFSR_OT_render_reference(TaskOperator, bpy.types.Operator):
    """Path trace every view of some lenses without reconstruction, and measure how close the rendered image is"""

    bl_idname = "lfsr.render_reference"
    bl_label = "Render Reference + SSIM"

    def prepare(self, context: bpy.types.Context) -> Job:
        scene = context.scene
        scene_settings.resolve(scene).check_light_field("a reference")
        request, finish = folders.requested(scene)
        folder = folders.finished_frame(scene, "to compare")
        if not folders.is_made(request, finish):
            raise LfsrError(f"the image in {folder} was made with other settings: render the EIA again first")
        target = folder.with_name(f"{folder.name}_reference")

        def say_ssim(result: dict[str, Any]) -> None:
            metrics = result["metrics"]
            ssim = metrics.get("ssim_eia_fg", metrics.get("ssim_lens_fg"))
            session.say("No SSIM: no lens shows any foreground" if ssim is None else
                        f"SSIM of the foreground {ssim:.4f}")

        return Job("reference", {"request": request, "output": str(target), "lenses": scene.lfsr.reference_lenses,
                                 "samples": scene.lfsr.reference_samples},
                   say_ssim, output=target, kept=functools.partial(folders.kept, target))


class LFSR_OT_preview_view(TaskOperator, bpy.types.Operator):
    """Show the view from the eye's position in the Image Editor; the sliders then move the eye"""

    bl_idname = "lfsr.preview_view"
    bl_label = "Preview View"

    def prepare(self, context: bpy.types.Context) -> Job | None:
        """Decode the current frame's views unless they are there, then show one."""
        scene = context.scene
        folder = folders.finished_frame(scene, "to preview")
        views, name = folders.views_file(folder), scene.name_full
        if folders.is_decoded(folder):
            _show_view(name, views)
            return None
        return Job("decode", {"folder": str(folder), "views": str(views)}, lambda _: _show_view(name, views))


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
        frame, lacks = read_rendered(folders.frame_folder(scene)), bool(runtime.why_missing())
    except LfsrError:
        return []
    names = [MethodName.parse(name) for name in (*MENU, *MORE)]
    fits = [name for name in names if (name.text in SUBPIXEL_METHODS if frame.subpixels
                                       else (name.upscaler == AS_RENDERED) == (frame.scale == 1))]
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
        return Job("finish", {"folder": str(folder), "finish": finish, "views": str(folders.views_file(folder))},
                   lambda _: show_image_of(name, folder), output=folder)


class LFSR_OT_cancel(bpy.types.Operator):
    """Stop the light-field render; finished frames stay, and a long frame can be continued"""

    bl_idname = "lfsr.cancel"
    bl_label = "Cancel Light Field Render"

    def execute(self, _context: bpy.types.Context) -> Result:
        if (task := session.cancel()) is None:
            self.report({"WARNING"}, "No light-field render is running")
            return {"CANCELLED"}
        session.say(". ".join(filter(None, ("Cancelled", task.job.kept()))))
        return {"FINISHED"}


def image_job(scene: bpy.types.Scene, shows_first: bool = False, number: int | None = None) -> Job:
    """Return the job that renders a frame, by default the current one, and shows it; LfsrError where it cannot be.

    ``shows_first``: a rough view of its middle, before the image is rendered.
    """
    folders.try_output(scene)
    add_missing_array(scene)
    request, finish = folders.requested(scene, number)
    finish = dataclasses.replace(finish, temporal_averaging=0)  # only an animation has neighbouring frames
    folder, name = Path(request.output), scene.name_full
    if shows_first:
        request = dataclasses.replace(request, first_view=str(runtime.temporary("first", folder).with_suffix(".npy")),
                                      calm=CALM if MethodName.parse(finish.method).needs_denoiser else CALM / 2)

    def notice(told: Notice) -> bool:
        if told.code == "first-view":
            _show_view(name, Path(told.values["path"]))
            session.say(FIRST_VIEW)
        return told.code == "first-view"

    def ended(_result: dict[str, Any]) -> None:
        show_image_of(name, folder)
        if (rendered := _scene(name)) is not None and rig.find(rendered) is None:
            edit.remove_planes(rendered)  # of an array that was deleted meanwhile
        folders.learn(name, FrameFolder(folder).rendered, request)

    return Job("make", {"request": request, "finish": finish, "overwrite": True,
                        "views": str(folders.views_file(folder))},
               ended, notice, folder, kept=functools.partial(folders.kept, folder))


def animation_job(scene: bpy.types.Scene) -> Job:
    """Return the job that renders the frames that are missing, then shows the last image and a summary."""
    add_missing_array(scene)
    request, finish, frames = folders.requested_animation(scene)
    output = Path(request.output)
    last = FrameFolder.of_frame(output, frames[-1]).path
    return Job("make", {"request": request, "finish": finish, "frames": list(frames),
                        "overwrite": scene.lfsr.use_overwrite, "views": str(folders.views_file(last))},
               functools.partial(_end_animation, scene.name_full), output=output, frames=frames,
               kept=lambda: folders.CONTINUE)


def _asked(scene: bpy.types.Scene, frames: Sequence[int]) -> list[Question]:
    find_subject(scene)  # where nothing would be rendered, nothing else matters
    add_missing_array(scene)
    targets = [] if scene.lfsr.use_overwrite else [folders.frame_folder(scene, number) for number in frames]
    foreign = [Question(folders.foreign(folder), "Overwrite", "turn on Overwrite, or choose another output folder")
               for folder in targets if not folders.is_own(scene, folder)]
    return [*_denoising(scene), *foreign[:1], *check_questions(scene, len(frames))]


def to_ask(scene: bpy.types.Scene, frames: int = 1) -> list[Problem]:
    """Return what an artist is asked about before a render of ``frames`` images."""
    problems = [problem for check in (*ASKING, look.find) for problem in check(scene) if problem.asks]
    return [*problems, *disks(scene, frames)]


def check_questions(scene: bpy.types.Scene, frames: int = 1) -> list[Question]:
    """Return what an artist is asked before ``frames`` images of ``scene``, once for each thing in a file."""
    keyed = [((scene.name_full, problem.code, problem.target), problem) for problem in to_ask(scene, frames)]
    new = [problem for key, problem in keyed if key not in _accepted]
    accept = functools.partial(_accepted.update, [key for key, _ in keyed])
    mends = [problem for code in MENDS for problem in new if problem.code == code]
    said = {*MENDS, "clear"} if any(problem.code == "alpha" for problem in mends) else MENDS
    rows = grouped(problem for problem in new if problem.code not in said)
    asked = [Question(problem.reason.rstrip("."), "Render", accept=accept, mend=MENDS[problem.code][0],
                      title=problem.fix, mends=functools.partial(FIXES[problem.code], scene, problem.target,
                                                                 *filter(None, [problem.placed])))
             for problem in mends]
    # Images that will take long, again where they will take longer than was accepted.
    seconds, what = frames * (folders.expected_seconds(scene) or 0), "The image" if frames == 1 else f"{frames} images"
    key = scene.name_full, "time", f"{max(seconds, 1.0):.0e}"
    if seconds >= LONG and key not in _accepted:
        asked.append(Question(f"{what} will take about {duration(seconds)}", "Render",
                              accept=functools.partial(_accepted.add, key)))
    asked += [Question((row.reason if row.count == 1 else f"{row.title}. {row.reason}").rstrip("."), "Render",
                       accept=accept) for row in rows[:MOST_ROWS]]
    if len(rows) > MOST_ROWS:
        asked.append(Question(f"Scene Check lists {len(rows) - MOST_ROWS} more", "Render", accept=accept))
    return asked


def _denoising(scene: bpy.types.Scene) -> list[Question]:
    settings = scene_settings.resolve(scene)
    if not (lacking := runtime.lacking(settings)):
        return []

    def use_replacement() -> None:
        runtime.use_replacement(scene, settings)
        bpy.ops.ed.undo_push(message="Set Method")

    # Where no method was chosen, the answer of another scene holds.
    if not scene.lfsr.is_property_set("method") and getattr(runtime.preferences_of_addon(), "without_denoiser", False):
        use_replacement()
        return []
    name, where = title(settings.method.undenoised.text), runtime.where_to_get()
    return [Question(lacking, f"Use {name}", f"choose the method {name}, or get it. {where}",
                     f"{name} takes twice the rays. {where}", use_replacement)]


def show_image_of(scene_name: str, folder: Path) -> None:
    """Show what the eye sees of the image in ``folder``, or the image of a panel with a lens sheet itself."""
    views, panel = folders.views_file(folder), folder / PANEL_FILE
    if not (folder / EIA_FILE).is_file():
        images.unload(scene_name)  # the views of an earlier render do not belong to this image
    elif views.is_file():
        _show_view(scene_name, views)
    if panel.is_file():
        images.open_file(panel)
    bpy.context.window_manager.lfsr.outcome_folder = str(folder)


def _scene(name: str) -> bpy.types.Scene | None:
    """The scene of a full name in the open file."""
    return next((scene for scene in bpy.data.scenes if scene.name_full == name), None)


def _end_animation(scene_name: str, result: dict[str, Any]) -> None:
    made = result["made"]  # data of ``pipeline.make.Made``
    for frame in made:
        print(f"frame {frame['frame']}: {frame['state']} {frame['error']}".rstrip())
    count = Counter(frame["state"] for frame in made)
    states = ", ".join(f"{count[state]} {state}" for state in ("made", "kept", "failed"))
    said = f"{counted(len(made), 'frame')}: {states}"
    if failed := [frame for frame in made if frame["state"] == "failed"]:
        raise LfsrError(f"{said}; frame {failed[0]['frame']}: {failed[0]['error']}; press Render Animation again to "
                        "make what is missing")
    show_image_of(scene_name, Path(made[-1]["folder"]))
    session.say(said)


def _show_view(scene_name: str, views: Path) -> None:
    if (scene := _scene(scene_name)) is not None:
        images.load(scene, views)
        images.in_editor(images.show(scene, (scene.lfsr.eye_right, scene.lfsr.eye_up)))


class LFSR_OT_submit(DescribedByItem, AsksForFile, bpy.types.Operator):
    """Write a job that renders the timeline's range on a render farm, into a folder that its machines can see"""

    bl_idname = "lfsr.submit"
    bl_label = "Write Farm Job"
    item = "farm"

    farm: bpy.props.EnumProperty(name="Farm", description="Render farm that the job is for", items=FARM_ITEMS)
    directory: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH", description="Folder for the job's files; "
        "every machine must see it under the same path", options={"SKIP_SAVE", "PATH_SUPPORTS_BLEND_RELATIVE"})
    parts: bpy.props.IntProperty(
        name="Parts", description="Number of parts, by rows of lenses, of each frame", min=1, soft_max=64, default=1)
    filter_folder: bpy.props.BoolProperty(
        name="Folders", description="Show folders only", default=True, options={"HIDDEN"})

    @reports_errors
    def execute(self, context: bpy.types.Context) -> Result:
        if not self.directory.strip():
            raise LfsrError("no folder is chosen for the farm's job: give one that every machine of the farm can see")
        folder = scene_settings.absolute(self.directory, "the folder of the job")
        command, note = submit(context.scene, self.farm, folder, self.parts)
        context.window_manager.clipboard = command
        print(f"Light Field: the job is in {folder}. Next (in the clipboard): {command}")
        session.tell(f"The job is in the folder {folder.name}, and its next command in the clipboard. {note}", "INFO")
        return {"FINISHED"}


def submit(scene: bpy.types.Scene, farm: str, folder: Path, parts: int) -> tuple[str, str]:
    """Write the job of the timeline's range for ``farm``, "openjd" or "flamenco", with ``parts`` parts per frame.

    A copy of the file, the farm's template and the panel's settings go into ``folder``, which is created where it is
    missing; every machine of the farm must see it under the same path. LfsrError where the scene cannot be rendered or
    the folder cannot be written to.
    """
    scene_settings.resolve(scene).check_light_field("a farm's job")
    request, finish, frames = folders.requested_animation(scene)
    if request.sampling.scales:
        with compat.wait_cursor():
            request = request.with_scale(scale_of(scene, request))
    with system_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    display = ""
    if scene.lfsr.display == PROFILE_FILE:
        path = scene_settings.absolute(scene.lfsr.profile_file, "the display profile")
        display = str(folder / path.name)
        if path.resolve() != Path(display).resolve():
            with atomic_path(display) as temporary:
                shutil.copyfile(path, temporary)
    copy = folder / f"{scene_settings.file_stem()}{COPY_SUFFIX}"
    with atomic_path(copy) as temporary:
        save_copy(temporary)
    copy_simulations(copy)
    request = dataclasses.replace(request, scene=str(copy))
    return write_job(farm, folder, request, finish, frames, parts, display)


class LFSR_MT_submit(bpy.types.Menu):
    """Render farms that can render the timeline's range"""

    bl_label = "Submit"

    def draw(self, _context: bpy.types.Context) -> None:
        for name, text, _ in FARM_ITEMS:
            self.layout.operator("lfsr.submit", text=f"{text}…").farm = name


@bpy.app.handlers.persistent
def _forget(*_: object) -> None:
    _accepted.clear()


unregister = _forget
HANDLERS = (("load_post", _forget),)
CLASSES = (LFSR_OT_render_eia, LFSR_OT_render_animation, LFSR_OT_render_reference, LFSR_OT_preview_view,
           LFSR_OT_finish_frame, LFSR_OT_cancel, LFSR_OT_submit, LFSR_MT_submit)
