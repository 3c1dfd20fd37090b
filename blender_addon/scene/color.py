"""The scene's colour management for the second stage; LfsrError for settings that it cannot reproduce."""

from __future__ import annotations

import math
import os
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.images.color_settings import ColorSettings

from .. import compat
from .subject import GEOMETRY

WORKING_SPACE = "Linear Rec.709"


def color_settings(scene: bpy.types.Scene, world_visible: bool = False) -> ColorSettings:
    """Return the settings with which the second stage shows the colours that Blender shows; LfsrError if it cannot."""
    view = scene.view_settings
    for name in ("exposure", "gamma"):
        if not math.isfinite(getattr(view, name)):
            raise LfsrError(f"the scene's view {name} is {getattr(view, name)}, but it must be a finite number: "
                            "set it in Render Properties, Color Management")
    for switch, name in (("use_curve_mapping", "curves"), ("use_white_balance", "white balance")):
        if getattr(view, switch):
            raise LfsrError(f"the scene's view uses {name}, which light-field images cannot show: switch off {name} "
                            "in Render Properties, Color Management, or apply it to the finished image")
    space = compat.working_space()
    if space != WORKING_SPACE:
        raise LfsrError(f"the file's working space is {space}, but renders must be in {WORKING_SPACE}: choose "
                        f"{WORKING_SPACE} in Render Properties, Color Management")
    if world_visible and (names := _catchers(scene)):
        raise LfsrError(f"{names[0]!r} is a shadow catcher in front of a visible world, which would render too dark: "
                        "make the film transparent or switch Shadow Catcher off")
    config = os.environ.get("OCIO") or str(
        Path(bpy.utils.system_resource("DATAFILES"), "colormanagement", "config.ocio"))
    return ColorSettings(scene.display_settings.display_device, view.view_transform, view.look or "None",
                         view.exposure, view.gamma, config)


def _catchers(scene: bpy.types.Scene) -> list[str]:
    """Objects that catch shadows in renders, with those whose instancer does.

    In 5.2 lights have the same switch with another meaning.
    """
    marked = {item for item in scene.objects if item.is_shadow_catcher}
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance and (instance.object.is_shadow_catcher or instance.parent.is_shadow_catcher):
            marked.add(instance.object.original)
    return sorted(item.name for item in marked if item.type in GEOMETRY and not item.hide_render)
