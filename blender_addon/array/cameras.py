"""The choice of the scene camera that the array stands at."""

from __future__ import annotations

import bpy

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.frames.job import FIT

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
        known = f"{did_you_mean(name, names)}Choose one of {', '.join(names[:MOST_NAMES])}" if names else "It has none"
        raise LfsrError(f"the scene has no camera {name!r}: {known}, or {FIT} to place the array in front of the "
                        "subject")
    if not rig.is_array(camera):
        rig.forget(scene)
    scene.camera = camera


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's cameras in the order of its objects."""
    return [item for item in scene.objects if item.type == "CAMERA"]


def choice_notice(scene: bpy.types.Scene) -> str:
    """Return the notice for a file without an active camera: which one is used, and how to use another."""
    others = [item.name for item in cameras(scene) if item != scene.camera]
    named = f"{', '.join(others[:MOST_NAMES])} or " if others else ""
    return (f"The file's camera {scene.camera.name!r} is used. Choose another with --camera: {named}{FIT}, which "
            "places the array in front of the subject")


def mirror_notice(scene: bpy.types.Scene) -> str:
    """Return the notice on an array or camera that is its own mirror image, "" if it is not."""
    camera = rig.find(scene) or scene.camera
    if camera is None or not is_mirrored(camera):
        return ""
    return (f"Camera {camera.name!r} is mirrored by a negative scale, of its own or of a parent. The mirror is undone: "
            "left and right are as in the scene")
