"""How Blender shows a scene, as far as the second stage can show it the same way; what it cannot is refused."""

from __future__ import annotations

import math
import os
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.images.color_settings import ColorSettings

from .. import compat
from ..scene.subject import GEOMETRY

WORKING_SPACE = "Linear Rec.709"


def color_settings(scene: bpy.types.Scene, world_visible: bool = False) -> ColorSettings:
    """Names that the second stage needs to look the same; LfsrError for what it would show in other colours."""
    _check_view(scene.view_settings)
    space = compat.working_space()
    if space != WORKING_SPACE:
        raise LfsrError(f"the file's working space is {space}, but renders are read as {WORKING_SPACE}: choose "
                        f"{WORKING_SPACE} in Render Properties, Color Management")
    if world_visible and (names := _catchers(scene)):
        raise LfsrError(f"{names[0]!r} is a shadow catcher before a visible world, which comes out too dark: make "
                        "the film transparent or take Shadow Catcher off")
    view = scene.view_settings
    config = os.environ.get("OCIO") or str(
        Path(bpy.utils.system_resource("DATAFILES"), "colormanagement", "config.ocio"))
    return ColorSettings(scene.display_settings.display_device, view.view_transform, view.look or "None",
                         view.exposure, view.gamma, config)


def _check_view(view: bpy.types.ColorManagedViewSettings) -> None:
    for name in ("exposure", "gamma"):
        if not math.isfinite(getattr(view, name)):
            raise LfsrError(f"the scene's view {name} is {getattr(view, name)}, but it must be a finite number: "
                            "set it in Render Properties, Color Management")
    for switch, name in (("use_curve_mapping", "curves"), ("use_white_balance", "white balance")):
        if getattr(view, switch):
            raise LfsrError(f"the scene's view uses {name}, which eia.png would not show: take them off in Render "
                            "Properties, Color Management, or set them on the finished image")


def _catchers(scene: bpy.types.Scene) -> list[str]:
    """Objects that catch shadows in renders; lights carry the same switch in 5.2, where it means something else."""
    return sorted(item.name for item in scene.objects
                  if item.type in GEOMETRY and item.is_shadow_catcher and not item.hide_render)
