"""Find what light-field renders leave out, ignore or refuse of a scene. Blender's defaults that do no harm are none."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from lfsr_core.base.errors import LfsrError

from ..scene.color import color_settings
from ..scene.light import AUTO_LIGHT, OWN_LIGHT, has_light
from ..scene.notices import left_out
from ..scene.sentences import sentence
from ..scene.words import capitalized
from .problem import ERROR, INFO, Problem

# Code of the problem, title and button of what renders leave out, by the code of its notice.
LEFT_OUT = {"libraries-missing": ("linked", "Linked Files", "Find Files…"),
            "scripts-off": ("autoexec", "Scripts", "Reload Trusted"),
            "shift-ignored": ("shift", "Camera Shift", "Reset Shift"),
            "override-ignored": ("override", "Material Override", "Clear Override"),
            "layers-left-out": ("layers", "View Layers", "Switch Off Others"),
            "compositor-ignored": ("compositor", "Compositor", "Switch Off"),
            "sequencer-ignored": ("sequencer", "Sequencer", "Switch Off")}
# Title and button of what a view layer does with collections.
SWITCHED = {"exclude": ("Excluded Collections", "Include"), "holdout": ("Holdouts", "Switch Off"),
            "indirect_only": ("Indirect-Only Collections", "Switch Off")}


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
        values = notice.values
        code, title, button = (values["switch"], *SWITCHED[values["switch"]]) if "switch" in values else (
            LEFT_OUT[notice.code])
        target = values.get("camera") or values.get("layer") or scene.name
        yield Problem(code, target, f"{sentence(notice)}.", button, INFO, title=title, asks=True)


def _shows_world(scene: bpy.types.Scene) -> bool:
    """True if the scene's own world is seen behind a subject that may catch shadows."""
    is_own = scene.lfsr.light == OWN_LIGHT or (scene.lfsr.light == AUTO_LIGHT and has_light(scene))
    # Whether any object catches shadows is asked here, since finding those of instances takes long.
    return is_own and scene.world is not None and not scene.render.film_transparent and any(
        item.is_shadow_catcher for item in bpy.data.objects)
