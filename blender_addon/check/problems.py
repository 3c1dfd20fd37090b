"""Check a scene before rendering: what will go wrong on its display."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice

from ..jobs import denoiser, preview
from ..scene import devices, folders
from ..scene import settings as scene_settings
from ..scene.array import rig
from ..scene.array.spaces import is_mirrored
from ..scene.light import AUTO_LIGHT, SCENE_LIGHTS, has_light, is_dim
from ..scene.notices import missing_images
from ..scene.sentences import sentence
from ..scene.settings import title
from ..scene.subject import find_subject
from ..scene.words import capitalized
from . import disk, geometry, ignored
from .problem import ERROR, INFO, SEVERITIES, Problem


def check_scene(scene: bpy.types.Scene) -> list[Problem]:
    """Return everything found, worst first."""
    return _sorted(problem for check in (*QUICK, _denoiser, _geometry) for problem in check(scene))


def to_ask(scene: bpy.types.Scene, frames: int = 1) -> list[Problem]:
    """Return what an artist is asked about before a render of ``frames`` images, worst first."""
    found = [problem for check in QUICK if check is not disk.find for problem in check(scene) if problem.asks]
    return _sorted([*found, *disk.find(scene, frames)])


def _sorted(problems: Iterable[Problem]) -> list[Problem]:
    return sorted(problems, key=lambda problem: SEVERITIES.index(problem.severity))


def _renderer(scene: bpy.types.Scene) -> Iterator[Problem]:
    if not _has_cycles():
        yield Problem("cycles", "Cycles", "Light fields are rendered with Cycles, but the Cycles Render Engine add-on "
                      "is switched off: switch it on.", "Show Add-ons", ERROR)
    elif scene.render.engine != "CYCLES":
        yield Problem("engine", scene.name, "Light fields are rendered with Cycles. Materials and lights may look "
                      "different in the scene's own render engine.", "Use Cycles", INFO)


def _settings(scene: bpy.types.Scene) -> Iterator[Problem]:
    output = ("output", "Choose Folder…") if bpy.data.filepath else ("unsaved", "Save File…")
    for (code, fix), target, check in (
            (("display", "Use Defaults"), "Display", scene_settings.check),
            (output, "Output", folders.scene_folder),
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
    if is_mirrored(array):
        yield Problem("mirror", array.name, f"{sentence(Notice('camera-mirrored', {'camera': array.name}))}.",
                      severity=INFO, is_object=True)


def _light(scene: bpy.types.Scene) -> Iterator[Problem]:
    if scene.lfsr.light not in SCENE_LIGHTS:
        return
    if not has_light(scene):
        becomes = ("It will be lit with one of Blender's world images." if scene.lfsr.light == AUTO_LIGHT
                   else "The image will be black.")
        yield Problem("light", scene.name, f"The scene has no light. {becomes}", "Add World Light", asks=True)
    elif is_dim(scene):
        yield Problem("dim", scene.name, "The world is the only light and almost dark, and so will be the image. "
                      "Increase its strength or add lights.", "Add World Light", asks=True)


def _scripts(scene: bpy.types.Scene) -> Iterator[Problem]:
    if not _has_cycles() or (scene_settings.device_of(scene) in devices.WITH_OSL_CAMERA and devices.has_osl()
                             and getattr(scene.cycles, "shading_system", False)):
        return
    slots = (slot.material for item in scene.objects if not item.hide_render for slot in item.material_slots)
    for material in sorted(set(filter(None, slots)), key=lambda material: material.name):
        if _has_script(material.node_tree):
            yield Problem("script", material.name, "The material has a Script node, which needs the CPU or OptiX as "
                          "device, and Open Shading Language switched on in Render Properties.", "Use CPU and OSL",
                          asks=True)


def _images(scene: bpy.types.Scene) -> Iterator[Problem]:
    for path in missing_images():
        yield Problem("texture", bpy.path.basename(path), f"The image file is missing and renders magenta: {path}",
                      "Find Files…", ERROR, asks=True)
    for image in bpy.data.images:
        if image.is_dirty and image.users and image.name != preview.IMAGE_NAME:
            yield Problem("dirty", image.name, "The image has unsaved changes, which the render would not show.",
                          "Pack", asks=True)


def _geometry(scene: bpy.types.Scene) -> Iterator[Problem]:
    array = rig.find(scene)
    if array is None:
        return
    try:
        placed, subject = rig.placement(scene, scene_settings.display_of(scene)), find_subject(scene)
    except LfsrError as error:
        yield Problem("rig", array.name, f"{capitalized(str(error))}.", "Add Again", ERROR, is_object=True)
        return
    with suppress(LfsrError):  # said by _settings
        settings = scene_settings.resolve(scene)
        # Where nothing is reconstructed, marking the background saves no time.
        yield from (problem for problem in (geometry.find(scene, settings, placed, subject) if placed else ())
                    if not settings.subpixels or problem.code != "background")


def _denoiser(scene: bpy.types.Scene) -> Iterator[Problem]:
    try:
        settings = scene_settings.resolve(scene)
        lacking = denoiser.lacking(settings)
    except LfsrError:
        return  # said by _settings, or by the render
    if lacking:
        yield Problem("denoise", "Open Image Denoise", f"{lacking}. {denoiser.where_to_get()}.",
                      f"Use {title(denoiser.replacement(settings).text)}", ERROR)


def _has_cycles() -> bool:
    return bpy.context.preferences.addons.get("cycles") is not None


def _has_script(tree: bpy.types.NodeTree | None) -> bool:
    nodes = (node for node in tree.nodes if not node.mute) if tree is not None else ()
    return any(node.type == "SCRIPT" or (node.type == "GROUP" and _has_script(node.node_tree)) for node in nodes)


# What takes no longer in a scene of many objects than looking at each of them once.
QUICK = (_renderer, _settings, _array, _light, _scripts, _images, disk.find, ignored.find)
