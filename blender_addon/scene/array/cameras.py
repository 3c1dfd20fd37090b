"""The choice of the scene camera that the array stands at."""

from __future__ import annotations

import bpy

from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.base.notices import Notice
from lfsr_core.frames.request import FIT

from . import rig
from .spaces import is_mirrored

MOST_NAMES = 5


def choose_camera(scene: bpy.types.Scene, name: str) -> None:
    """Make the camera ``name`` the active one; FIT leaves the scene without an active camera.

    The scene's own camera array is ignored from then on. LfsrError if the scene has no such camera.
    """
    camera = next((item for item in cameras(scene) if item.name == name), None)
    if camera is None and name != FIT:
        names = [item.name for item in cameras(scene)]
        others = f"{did_you_mean(name, names)}Choose one of {', '.join(names[:MOST_NAMES])}" if names else "It has none"
        raise LfsrError(f"the scene has no camera {name!r}: {others}, or {FIT} to place the array in front of the "
                        "subject")
    if not rig.is_array(camera):
        rig.forget(scene)
    scene.camera = camera


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's cameras in the order of its objects."""
    return [item for item in scene.objects if item.type == "CAMERA"]


def camera_notices(scene: bpy.types.Scene, asked: str | None, is_imported: bool) -> list[Notice]:
    """Return what to know of the camera that the array stands at.

    ``asked``: name that was asked for, None for none; ``is_imported``: whether the file's format has no active camera.
    """
    camera = rig.find(scene) or scene.camera
    others = [item.name for item in cameras(scene) if item != scene.camera]
    if camera is None:
        return [Notice("camera-missing", {"others": others})] if asked is None else []
    is_choice = is_imported and asked is None and scene.camera is not None
    chosen = [Notice("camera-chosen", {"camera": scene.camera.name, "others": others})] if is_choice else []
    return [*chosen, *([Notice("camera-mirrored", {"camera": camera.name})] if is_mirrored(camera) else [])]
