"""What the fix buttons of the scene check do, by the code of the problem."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from lfsr_core.errors import LfsrError

from ..array.edit import add
from ..array.rig import check_editable
from ..background import denoiser
from ..scene.light import add_light
from ..scene.subject import BACKGROUND_COLLECTION
from ..settings import scene_settings

Fix = Callable[[bpy.types.Scene, str], None]


def find_object(name: str) -> bpy.types.Object:
    """Return the object ``name`` of the open file; LfsrError if it is gone."""
    item = bpy.data.objects.get(name)
    if item is None:
        raise LfsrError(f"object {name!r} is not there any more: check the scene again")
    return item


def _setting(group: str, **values: object) -> Fix:
    """Fix that sets properties of ``scene.group``."""
    def fix(scene: bpy.types.Scene, _target: str) -> None:
        for name, value in values.items():
            setattr(getattr(scene, group), name, value)
    return fix


def _add_light(scene: bpy.types.Scene, _target: str) -> None:
    add_light(scene).name = "Light Field World"


def _pack(_scene: bpy.types.Scene, target: str) -> None:
    image = bpy.data.images.get(target)
    if image is None:
        raise LfsrError(f"image {target!r} is not there any more: check the scene again")
    image.pack()


def _to_background(scene: bpy.types.Scene, target: str) -> None:
    item = find_object(target)
    background = bpy.data.collections.get(BACKGROUND_COLLECTION)
    if background is None:
        background = bpy.data.collections.new(BACKGROUND_COLLECTION)
    check_editable(background)
    if background not in scene.collection.children_recursive:
        scene.collection.children.link(background)
    if item.name not in background.objects:
        background.objects.link(item)
    for collection in item.users_collection:
        if collection != background and collection.library is None:
            collection.objects.unlink(item)


def _no_focus(_scene: bpy.types.Scene, target: str) -> None:
    camera = find_object(target).data
    check_editable(camera)
    camera.dof.use_dof = False


FIXES: dict[str, Fix] = {
    "cycles": lambda _scene, _target: bpy.ops.preferences.addon_enable(module="cycles"),
    "array": lambda scene, _target: add(scene, scene_settings.display_of(scene)), "light": _add_light,
    "dim": _add_light,
    "engine": _setting("render", engine="CYCLES"),
    "script": _setting("cycles", device="CPU", shading_system=True), "dirty": _pack, "background": _to_background,
    "denoise": lambda scene, _target: denoiser.use_replacement(scene, scene_settings.resolve(scene)),
    "filter": _setting("cycles", pixel_filter_type="BOX"), "denoiser": _setting("cycles", use_denoising=False),
    "motion": _setting("render", use_motion_blur=False), "focus": _no_focus}
OUTSIDE_SCENE = ("cycles", "dirty", "focus")  # fixes that change more than the scene
