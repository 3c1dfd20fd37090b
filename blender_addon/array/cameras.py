"""Which camera of a file the array stands at."""

from __future__ import annotations

import bpy

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.frames.job import FIT

from . import rig

MOST_NAMES = 5


def choose_camera(scene: bpy.types.Scene, name: str) -> None:
    """Make the camera ``name`` the active one, FIT none; LfsrError if the scene has no such camera.

    A camera array that was placed in the scene does not take its place: the camera was asked for by name.
    """
    camera = next((item for item in cameras(scene) if item.name == name), None)
    if camera is None and name != FIT:
        raise LfsrError(_unknown(name, [item.name for item in cameras(scene)]))
    if not rig.is_array(camera):
        rig.forget(scene)
    scene.camera = camera


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The scene's cameras, in the order in which they came into it."""
    return [item for item in scene.objects if item.type == "CAMERA"]


def choice_notice(scene: bpy.types.Scene) -> str:
    """For a file without an active camera: which one is used, and how to use another."""
    others = [item.name for item in cameras(scene) if item != scene.camera]
    rest = f"--camera takes another, {', '.join(others[:MOST_NAMES])}, or" if others else "--camera takes"
    return f"seen from the file's camera {scene.camera.name!r}; {rest} {FIT} for a place before the subject"


def _unknown(name: str, names: list[str]) -> str:
    known = f"{did_you_mean(name, names)}Choose one of {', '.join(names[:MOST_NAMES])}" if names else "It has none"
    return f"the scene has no camera {name!r}: {known}, or {FIT} for a place before the subject"
