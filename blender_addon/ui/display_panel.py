"""Panel of the display: drawing only."""

from __future__ import annotations

import bpy

from lfsr_core.base.errors import LfsrError

from ..scene import settings as scene_settings
from ..scene.displays import PROFILE_FILE
from . import summary
from .drawing import LightFieldPanel, columns, facts, row_if, sentence
from .presets import LFSR_PT_presets


class LFSR_MT_scale(bpy.types.Menu):
    """One of this many views in each direction is rendered, the others are reconstructed"""

    bl_label = "Scale"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the scales that divide the display's views."""
        for name in scene_settings.offered_scales(context.scene):
            self.layout.prop_enum(context.scene.lfsr, "scale", name)


class LFSR_PT_display(LightFieldPanel, bpy.types.Panel):
    """The display that the image is for"""

    bl_label = "Display"
    bl_order = 0

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        """Draw the preset menu."""
        LFSR_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw profile, scale and resolutions."""
        lfsr = context.scene.lfsr
        self.layout.prop(lfsr, "display", text="")  # without a column for labels, where long names would be cut off
        if lfsr.display == PROFILE_FILE:
            columns(self.layout).prop(lfsr, "profile_file", text="File")
        if scene_settings.is_woven(context.scene):
            # Without a column for labels: its label is as long as the sidebar is wide.
            self.layout.prop(lfsr, "subpixels")
            row = self.layout.row(align=True)
            row.operator("lfsr.test_picture", text="Test Picture…")
            row.operator("lfsr.calibrate", text="Calibrate…")
        # The menu of scales, where Blender draws a property's.
        split = row_if(not scene_settings.renders_subpixels(context.scene), self.layout).split(factor=0.4)
        label = split.row()
        label.alignment = "RIGHT"
        label.label(text="Scale")
        split.menu("LFSR_MT_scale", text=lfsr.bl_rna.properties["scale"].enum_items[lfsr.scale].name)
        try:
            facts(self.layout, summary.display_facts(scene_settings.resolve(context.scene)))
        except LfsrError as error:
            sentence(self.layout, str(error), "ERROR", context)


CLASSES = (LFSR_MT_scale, LFSR_PT_display)
