"""Panel of the live view: drawing only."""

from __future__ import annotations

import bpy

from ..live import nodes, session
from ..live.scene import EYE
from ..scene import devices
from ..scene import settings as scene_settings
from .drawing import LightFieldPanel, columns, row_if, sentence

HOW_TO_PLACE = "Drag the new window to the display and make it full screen. It follows all changes here"


class LFSR_PT_live(LightFieldPanel, bpy.types.Panel):
    """The light field in a window of its own, as it renders"""

    bl_label = "Live"
    bl_order = 5

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, the settings and the notes."""
        layout, lfsr = self.layout, context.scene.lfsr
        if session.is_on():
            layout.operator("lfsr.live_stop", icon="PAUSE")
            layout.operator("lfsr.live_full_screen", icon="FULLSCREEN_ENTER")
        else:
            layout.operator("lfsr.live_start", icon="PLAY")
        column, woven = columns(layout), scene_settings.is_woven(context.scene)
        row_if(not woven, column).prop(lfsr, "live_scale")
        row_if(not lfsr.live_samples, column).prop(lfsr, "live_rays")
        column.prop(lfsr, "live_samples")
        row_if(nodes.can_interpolate() and not woven, column).prop(lfsr, "live_smooth")
        row_if(devices.has_denoiser(), column).prop(lfsr, "live_denoise")
        row_if(devices.has_denoiser() and lfsr.live_denoise, column).prop(lfsr, "live_denoise_start")
        for text, icon in notes(context.scene):
            sentence(layout, text, icon, context)
        if session.is_on(EYE):
            layout.operator("lfsr.live_eye_stop", icon="HIDE_ON")
        else:
            layout.operator("lfsr.live_eye_start", icon="HIDE_OFF")
        column = columns(layout).column(align=True)
        for name in ("live_eye_right", "live_eye_up", "live_eye_near"):
            column.prop(lfsr, name, slider=True)
        if session.message(EYE):
            sentence(layout, session.message(EYE), "ERROR", context)


def notes(scene: bpy.types.Scene) -> list[tuple[str, str]]:
    """Sentences with their icons: what this Blender cannot do, and what to do now."""
    found = []
    if not nodes.can_interpolate():
        found.append(("This Blender's viewport compositor cannot interpolate: each rendered view is repeated. "
                      "Blender 5.0 and later can", "INFO"))
    if scene.lfsr.live_denoise and not devices.has_denoiser():
        found.append(("This Blender was built without a denoiser: the live view shows its noise", "INFO"))
    if session.is_on():
        found.append((session.message(), "ERROR") if session.message() else ("The live window is exact", "CHECKMARK"))
        found.append((HOW_TO_PLACE, "INFO"))
    return found


CLASSES = (LFSR_PT_live,)
