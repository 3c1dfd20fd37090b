"""One finding of the scene check, rows of several ("4,998 objects are too thin"), and what settings and files give."""

import dataclasses
import math
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.frames.frame import EVEN

from .. import compat
from ..jobs import folders, images, runtime
from ..scene import settings as scene_settings
from ..scene.array import rig
from ..scene.contents import find_subject, left_out, materials, nodes_of, rendered, rendered_layer
from ..scene.files import SECONDS_IN_PANEL, unreadable
from ..scene.light import AUTO_LIGHT, OWN_LIGHT, SCENE_LIGHTS, has_light
from ..scene.settings import Resolved, color_settings, title
from ..scene.words import capitalized, sentence

ERROR, WARNING, INFO = SEVERITIES = ("ERROR", "WARNING", "INFO")
MOST_ROWS = 5  # that are shown at first
# Title and reason of several findings of a kind, by their code.
SEVERAL = {
    "thin": ("{} objects are too thin", "They are thinner than what the rendered views show at their depths. Choose a "
             "smaller scale or move them nearer to the display plane."),
    "depth": ("{} objects leave the usable depth", "The display blurs what is nearer or farther than the orange "
              "rectangles. Move them, or move the display plane."),
    "background": ("{} objects fill the display", "Every lens counts as foreground. Objects in a collection called "
                   "Background are reconstructed faster."),
    "texture": ("{} files are missing", "What needs them looks wrong."),
    "eevee": ("{} materials have nodes of EEVEE", "Cycles, with which light fields are rendered, leaves them out: "
              "what needs them has a plain color or is black. Connect shaders of Cycles."),
    "clear": ("{} materials have Alpha 0", "They show nothing. Set their Alpha to 1 to see them."),
    "dirty": ("{} images have unsaved changes", "The render would not show them."),
    "script": ("{} materials have Script nodes", "Script nodes need the CPU or OptiX as device, and Open Shading "
               "Language switched on in Render Properties.")}
# Bytes per rendered pixel of all layers, per finished pixel of an image, of its linear copy, and of its decoded views.
RENDERED, IMAGE, LINEAR, VIEWS, GIGABYTE = 48, 3, 6, 3, 1e9
# Code of the problem, title and button of what renders leave out, by the code of its notice.
LEFT_OUT = {"scripts-off": ("autoexec", "Scripts", "Reload Trusted"),
    "engine-ignored": ("engine", "Render Engine", "Use Cycles"), "eevee-nodes": ("eevee", "", ""),
    "material-clear": ("clear", "", ""), "filter-ignored": ("filter", "Pixel Filter", "Use Box"),
    "clamp-ignored": ("clamp", "Clamping", "Use Defaults"), "motion-ignored": ("motion", "Motion Blur", "Switch Off"),
    "markers-ignored": ("markers", "Camera Markers", ""), "border-ignored": ("border", "Render Region", "Switch Off"),
    "view-ignored": ("view", "Color Management", "Switch Off"),
    "aspect-ignored": ("aspect", "Pixel Aspect", "Use Square Pixels"), "lines-left-out": ("lines", "Lines", ""),
    "coordinates-differ": ("coordinates", "Window Coordinates", ""),
    "world-negative": ("negative", "Negative Light", ""), "focus-ignored": ("focus", "Depth of Field", "Switch Off"),
    "camera-sheared": ("sheared", "Sheared Camera", ""), "camera-parallel": ("parallel", "Orthographic Camera", ""),
    "world-override-ignored": ("world", "World Override", "Clear Override"),
    "shift-followed": ("shift", "Camera Shift", "Reset Shift"),
    "override-ignored": ("override", "Material Override", "Clear Override"),
    "layers-left-out": ("layers", "View Layers", "Switch Off Others"),
    "compositor-ignored": ("compositor", "Compositor", "Switch Off"),
    "sequencer-ignored": ("sequencer", "Sequencer", "Switch Off")}
HARMLESS = ("engine", "filter", "clamp", "shift")  # of which nobody is asked
# Title and button of what a view layer does with collections.
SWITCHED = {"exclude": ("Excluded Collections", "Include"), "holdout": ("Holdouts", "Switch Off"),
            "indirect_only": ("Indirect-Only Collections", "Switch Off")}


@dataclasses.dataclass(frozen=True)
class Problem:
    """One finding of the scene check."""

    code: str  # kind of problem, and key of its fix among the buttons' FIXES or OPERATORS
    target: str  # name of the object, image or setting
    reason: str  # a sentence for the artist
    fix: str = ""  # text of the button that removes the problem, empty for no button
    severity: str = WARNING
    is_object: bool = False  # whether ``target`` is an object that can be selected
    title: str = ""  # shown instead of ``target``
    asks: bool = False  # whether a render is started only after the artist was asked
    count: int = 1  # of the findings that a row stands for
    placed: rig.Placement | None = None  # of the array, where its fix moves that


def grouped(problems: Iterable[Problem]) -> list[Problem]:
    """Return the rows of ``problems``, worst first, else in their order; a row of several has no ``target``."""
    kinds: dict[tuple[str, ...], list[Problem]] = {}
    for problem in problems:
        key = (problem.code,) if problem.code in SEVERAL else (problem.code, problem.target, problem.reason)
        kinds.setdefault(key, []).append(problem)
    rows = []
    for first, *others in kinds.values():
        row = dataclasses.replace(first, title=first.title or first.target)
        if others:
            (title, reason), count = SEVERAL[first.code], 1 + len(others)
            row = dataclasses.replace(row, title=title.format(f"{count:,}"), reason=reason, target="", count=count)
        rows.append(row)
    return sorted(rows, key=lambda row: SEVERITIES.index(row.severity))


def _settings(scene: bpy.types.Scene) -> Iterator[Problem]:
    if "cycles" not in bpy.context.preferences.addons:
        yield Problem("cycles", "Cycles", "Light fields are rendered with Cycles, but the Cycles Render Engine add-on "
                      "is switched off: switch it on.", "Show Add-ons", ERROR)
    output = ("output", "Choose Folder…") if bpy.data.filepath else ("unsaved", "Save File…")
    for (code, fix), target, check in ((("display", "Use Defaults"), "Display", scene_settings.check),
                                       (output, "Output", folders.try_output),
                                       (("subject", "Show in Renders"), scene.name, find_subject)):
        try:
            check(scene)
        except LfsrError as error:
            yield Problem(code, target, f"{capitalized(str(error))}.", fix, ERROR)


def _array(scene: bpy.types.Scene) -> Iterator[Problem]:
    array, arrays = rig.find(scene), [item for item in scene.objects if rig.is_array(item)]
    if array is None:
        yield Problem("array", scene.name, "The scene has no camera array. Renders add one, at its camera or in front "
                      "of its objects.", "Add", INFO)
        return
    if len(arrays) > 1 and scene.camera not in arrays:
        yield Problem("arrays", array.name, f"The scene has {len(arrays)} camera arrays, of which this one is used. "
                      "Make another one the active camera to use it instead.", severity=INFO, is_object=True)
    if rig.is_mirrored(array):
        yield Problem("mirror", array.name, f"{sentence(Notice('camera-mirrored', {'camera': array.name}))}.",
                      severity=INFO, is_object=True)


def _light(scene: bpy.types.Scene) -> Iterator[Problem]:
    if scene.lfsr.light in SCENE_LIGHTS and not has_light(scene):
        becomes = ("It will be lit with one of Blender's world images." if scene.lfsr.light == AUTO_LIGHT
                   else "The image will be black.")
        yield Problem("light", scene.name, f"The scene has no light. {becomes}", "Add World Light",
                      severity=INFO if scene.lfsr.light == AUTO_LIGHT else WARNING, asks=scene.lfsr.light != AUTO_LIGHT)


def _scripts(scene: bpy.types.Scene) -> Iterator[Problem]:
    if "cycles" not in bpy.context.preferences.addons or (
            scene_settings.device_of(scene) in compat.WITH_OSL_CAMERA and compat.has_osl()
            and getattr(scene.cycles, "shading_system", False)):
        return
    for material in materials(scene):
        if any(node.type == "SCRIPT" for node in nodes_of(material.node_tree)):
            yield Problem("script", material.name, "The material has a Script node, which needs the CPU or OptiX as "
                          "device, and Open Shading Language switched on in Render Properties.", "Use CPU and OSL",
                          asks=True)


def _images(scene: bpy.types.Scene) -> Iterator[Problem]:
    for notice in unreadable(scene, seconds=SECONDS_IN_PANEL):
        yield Problem("texture", Path(notice.values["path"]).name, f"{sentence(notice)}.", "Find Files…", ERROR,
                      asks=True)
    for image in bpy.data.images:
        if image.is_dirty and image.users and image.name != images.IMAGE_NAME:
            yield Problem("dirty", image.name, "The image has unsaved changes, which the render would not show.",
                          "Pack", asks=True)
    number = scene.frame_current
    for item in sorted(rendered(scene) & {*rendered_layer(scene).objects}, key=lambda item: item.name):
        for domain in (modifier.domain_settings for modifier in item.modifiers if modifier.type == "FLUID"):
            folder = domain and Path(bpy.path.abspath(domain.cache_directory, library=item.library))
            kept = folder and any(folder.glob("data/*" if domain.cache_frame_offset else f"data/*_{number:04d}.*"))
            if folder and (not kept or (domain.domain_type == "GAS" and number == domain.cache_frame_start)):
                yield Problem("simulation", item.name, f"The simulation of frame {number} is not baked, lacks its "
                              "cache, or has hardly begun: bake it, or choose a later frame, else a liquid is rendered "
                              "as a block, and no smoke.", is_object=True, asks=True)


def denoiser(scene: bpy.types.Scene) -> Iterator[Problem]:
    try:
        settings = scene_settings.resolve(scene)
        lacking = runtime.lacking(settings)
    except LfsrError:
        return  # said by _settings, or by the render
    if lacking:
        yield Problem("denoise", "Open Image Denoise", f"{lacking}. {runtime.where_to_get()}.",
                      f"Use {title(settings.method.undenoised.text)}", ERROR)


def disks(scene: bpy.types.Scene, frames: int = 1) -> Iterator[Problem]:
    """The disks that have too little room for ``frames`` images of ``scene``."""
    try:
        settings, folder = scene_settings.resolve(scene), folders.scene_folder(scene)
    except LfsrError:
        return  # said elsewhere
    file = Path(bpy.data.filepath)  # of which a render has a copy, beside the decoded views
    work = VIEWS * math.prod(settings.display.eia_pixels) + (file.stat().st_size if file.is_file() else 0)
    for code, button, disk, needed, place in (
            ("disk", "Choose Folder…", "the disk of the output folder", frames * bytes_of_frame(settings), folder),
            ("temporary", "Open Preferences", "the disk of Blender's temporary files", work, Path(bpy.app.tempdir))):
        if (room := free(place)) < needed:
            yield Problem(code, "Disk Space", f"The render needs up to {needed / GIGABYTE:.2g} GB, but {disk} has only "
                          f"{room / GIGABYTE:.2g} GB free.", button, ERROR, asks=True)


def bytes_of_frame(settings: Resolved) -> int:
    """Bytes that one image may take in its frame folder, uncompressed."""
    finished = math.prod(settings.display.panel_pixels if settings.subpixels else settings.display.eia_pixels)
    rendered = finished // settings.display.finished_pixels(settings.sampling.scale)
    return RENDERED * rendered + (IMAGE + LINEAR * settings.finish.linear_exr) * finished


def free(folder: Path) -> float:
    """Free bytes of the disk that ``folder`` is on or will be; infinite where that cannot be told."""
    for place in (folder, *folder.parents):
        try:
            return shutil.disk_usage(place).free
        except FileNotFoundError:
            continue
        except OSError:
            break
    return float("inf")


def _ignored(scene: bpy.types.Scene) -> Iterator[Problem]:
    """Everything of ``scene`` that a render does not show as Blender's own would."""
    try:
        color_settings(scene, _shows_world(scene))
    except LfsrError as error:
        code, fix = ("catcher", "Make Film Transparent") if _shows_world(scene) else ("space", "")
        yield Problem(code, scene.name, f"{capitalized(str(error))}.", fix, ERROR, title="Colors")
    for notice in left_out(scene):
        values = notice.values
        code, title, button = (values["switch"], *SWITCHED[values["switch"]]) if "switch" in values else (
            LEFT_OUT[notice.code])
        target = next((values[name] for name in ("camera", "layer", "material") if name in values), scene.name)
        yield Problem(code, target, f"{sentence(notice)}.", button, INFO, is_object="camera" in values, title=title,
                      asks=code not in HARMLESS)


def _shows_world(scene: bpy.types.Scene) -> bool:
    """True if the scene's own world is seen behind a subject that may catch shadows."""
    is_own = scene.lfsr.light in (OWN_LIGHT, EVEN.upper()) or (scene.lfsr.light == AUTO_LIGHT and has_light(scene))
    return is_own and scene.world is not None and not scene.render.film_transparent


# What takes no longer in a scene of many objects than looking at each of them once; of these, what a render asks about.
QUICK = (_settings, _array, _light, _scripts, _images, disks, _ignored)
ASKING = (_light, _scripts, _images, _ignored)
