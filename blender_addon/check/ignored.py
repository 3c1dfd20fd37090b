"""Find what light-field renders leave out, ignore or refuse of a scene. Blender's defaults that do no harm are none."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from lfsr_core.base.errors import LfsrError

from ..scene.color import color_settings
from ..scene.light import AUTO_LIGHT, OWN_LIGHT, has_light
from ..scene.notices import left_out
from ..scene.words import capitalized
from .problem import ERROR, INFO, Problem

# Buttons by the code of the notice.
BUTTONS = {"linked": "Find Files…", "autoexec": "Reload Trusted", "shift": "Reset Shift", "override": "Clear Override",
           "exclude": "Include", "holdout": "Switch Off", "indirect_only": "Switch Off", "layers": "Switch Off Others",
           "compositor": "Switch Off", "sequencer": "Switch Off"}


def find(scene: bpy.types.Scene) -> Iterator[Problem]:
    """Everything of ``scene`` that a render does not show as Blender's own would."""
    cycles, camera = getattr(scene, "cycles", None), scene.camera
    if cycles is not None and cycles.pixel_filter_type not in (
            "BOX", cycles.bl_rna.properties["pixel_filter_type"].default):
        yield Problem("filter", "Pixel Filter", "This filter would mix neighbouring views. Light-field renders use a "
                      "box of one pixel instead.", "Use Box", INFO)
    if scene.render.use_motion_blur:
        yield Problem("motion", "Motion Blur", "Light-field renders ignore motion blur.", "Switch Off", INFO, asks=True)
    if camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
        yield Problem("focus", camera.name, "Light-field renders ignore depth of field, since the viewer's eye "
                      "focuses.", "Switch Off", INFO, is_object=True, asks=True)
    try:
        color_settings(scene, _shows_world(scene))
    except LfsrError as error:
        code, fix, view = "space", "", scene.view_settings
        if view.use_curve_mapping or view.use_white_balance:
            code, fix = "view", "Switch Off"
        elif _shows_world(scene):
            code, fix = "catcher", "Make Film Transparent"
        yield Problem(code, scene.name, f"{capitalized(str(error))}.", fix, ERROR, title="Colors")
    for notice in left_out(scene):
        yield Problem(notice.code, notice.target or scene.name, f"{notice.sentence}.", BUTTONS[notice.code], INFO,
                      title=notice.title, asks=True)


def _shows_world(scene: bpy.types.Scene) -> bool:
    """True if the scene's own world is seen behind a subject that may catch shadows."""
    is_own = scene.lfsr.light == OWN_LIGHT or (scene.lfsr.light == AUTO_LIGHT and has_light(scene))
    # Whether any object catches shadows is asked here, since finding those of instances takes long.
    return is_own and scene.world is not None and not scene.render.film_transparent and any(
        item.is_shadow_catcher for item in bpy.data.objects)
