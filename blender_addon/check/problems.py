"""What will go wrong with this scene on this display, before rendering.

A check is a generator of problems; ``fixes`` holds what their buttons do.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import bpy

from lfsr_core.errors import LfsrError

from ..array import rig
from ..render import devices
from ..results import preview
from ..scene.light import has_light
from ..scene.notices import missing_images
from ..scene.subject import find_subject
from ..settings import folders, scene_settings
from . import geometry

ERROR, WARNING, INFO = "ERROR", "WARNING", "INFO"
OWN_SHADER_NODES = {"SCRIPT"}


@dataclasses.dataclass(frozen=True)
class Problem:
    """One line of the check: ``code`` finds its fix, ``fix`` is the button's text (empty: none)."""

    code: str
    target: str
    reason: str
    fix: str = ""
    severity: str = WARNING
    is_object: bool = False


def check_scene(scene: bpy.types.Scene) -> list[Problem]:
    """Everything found, worst first."""
    checks = (_renderer, _display, _file, _array, _light, _scripts, _images, _geometry, _filters, _blur)
    found = [problem for check in checks for problem in check(scene)]
    return sorted(found, key=lambda problem: (ERROR, WARNING, INFO).index(problem.severity))


def _renderer(scene: bpy.types.Scene) -> Iterator[Problem]:
    if not _has_cycles():
        yield Problem("cycles", "Cycles", "The Cycles Render Engine add-on is switched off, and light fields are "
                      "rendered with it.", "Switch On", ERROR)
    elif scene.render.engine != "CYCLES":
        yield Problem("engine", scene.name, "Another render engine is chosen; light fields are rendered with Cycles, "
                      "so materials and lights may look different.", "Use Cycles", INFO)


def _display(scene: bpy.types.Scene) -> Iterator[Problem]:
    try:
        scene_settings.resolve(scene).check()
    except LfsrError as error:
        yield Problem("display", "Display", _sentence(error), severity=ERROR)


def _file(scene: bpy.types.Scene) -> Iterator[Problem]:
    try:
        folders.scene_folder(scene)
    except LfsrError as error:
        yield Problem("unsaved", "Output", _sentence(error), severity=ERROR)
    try:
        find_subject(scene)
    except LfsrError as error:
        yield Problem("subject", scene.name, _sentence(error), severity=ERROR)


def _array(scene: bpy.types.Scene) -> Iterator[Problem]:
    if rig.find(scene) is None:
        yield Problem("array", scene.name, "The scene has no camera array.", "Add", ERROR)
        return
    arrays = [item for item in scene.objects if rig.is_array(item)]
    if len(arrays) > 1 and scene.camera not in arrays:
        yield Problem("arrays", rig.find(scene).name, f"The scene has {len(arrays)} camera arrays and this one "
                      "is used; make another the active camera to use it.", severity=INFO, is_object=True)


def _light(scene: bpy.types.Scene) -> Iterator[Problem]:
    if not has_light(scene):
        yield Problem("light", scene.name, "Nothing in the scene shines. It will be lit with one of Blender's own "
                      "world images.", "Add World Light", WARNING)


def _scripts(scene: bpy.types.Scene) -> Iterator[Problem]:
    if not _has_cycles() or (scene_settings.device_of(scene) in devices.WITH_OSL_CAMERA and devices.has_osl()
                             and getattr(scene.cycles, "shading_system", False)):
        return
    for material in _materials_in_use(scene):
        if _has_script(material.node_tree):
            yield Problem("script", material.name, "The material has a Script node, which needs Open Shading Language: "
                          "a CPU or OptiX device, and the setting in Render Properties.", "Use CPU and OSL")


def _images(scene: bpy.types.Scene) -> Iterator[Problem]:
    for path in missing_images():
        yield Problem("texture", bpy.path.basename(path), f"The image file is missing, so what uses it renders "
                      f"magenta: {path}", severity=ERROR)
    for image in bpy.data.images:
        if image.is_dirty and image.users and image.name != preview.IMAGE_NAME:
            yield Problem("dirty", image.name, "The image has changes that are not saved, and the render would not "
                          "show them.", "Pack")


def _geometry(scene: bpy.types.Scene) -> Iterator[Problem]:
    try:
        display = scene_settings.display_of(scene)
        placed = rig.placement(scene, display)
        subject = find_subject(scene)
    except LfsrError as error:
        if rig.find(scene) is not None:
            yield Problem("rig", rig.find(scene).name, _sentence(error), severity=ERROR, is_object=True)
        return
    if placed is not None:
        direct = scene_settings.is_direct(scene)
        for found in geometry.find(scene, display, placed, subject):
            if found.code == "background" and direct:
                continue  # nothing is reconstructed that could take less time
            yield Problem(found.code, found.item.name, found.reason, found.fix, is_object=True)


def _filters(scene: bpy.types.Scene) -> Iterator[Problem]:
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return
    if cycles.pixel_filter_type != "BOX":
        yield Problem("filter", "Pixel Filter", "It would mix neighbouring views; light-field renders use a box of "
                      "one pixel instead.", "Use Box", INFO)
    if cycles.use_denoising:
        yield Problem("denoiser", "Denoise", "Cycles' denoiser would mix neighbouring views; light-field renders "
                      "switch it off and denoise with the method chosen under Quality.", "Switch Off", INFO)


def _blur(scene: bpy.types.Scene) -> Iterator[Problem]:
    if scene.render.use_motion_blur:
        yield Problem("motion", "Motion Blur", "It is ignored in light-field renders.", "Switch Off", INFO)
    camera = scene.camera
    if camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
        yield Problem("focus", camera.name, "Depth of field is ignored in light-field renders: the viewer's eye "
                      "focuses.", "Switch Off", INFO, is_object=True)


def _has_cycles() -> bool:
    return bpy.context.preferences.addons.get("cycles") is not None


def _materials_in_use(scene: bpy.types.Scene) -> list[bpy.types.Material]:
    slots = (slot.material for item in scene.objects if not item.hide_render for slot in item.material_slots)
    return sorted({material for material in slots if material is not None}, key=lambda material: material.name)


def _has_script(tree: bpy.types.NodeTree | None) -> bool:
    if tree is None:
        return False
    return any(node.type in OWN_SHADER_NODES or (node.type == "GROUP" and _has_script(node.node_tree))
               for node in tree.nodes if not node.mute)


def _sentence(error: LfsrError) -> str:
    text = str(error)
    return text[:1].upper() + text[1:] + "."
