"""Parts of panels: their place, labels beside values, sentences over several lines."""

from __future__ import annotations

import textwrap

import bpy

from ..scene.words import for_panel

PIXELS_PER_LETTER = 6.6


class LightFieldPanel:
    """Base of every panel of the tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Light Field"


def columns(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Column with labels left and values right, as in Blender's own panels."""
    column = layout.column()
    column.use_property_split = True
    column.use_property_decorate = False
    return column


def row_if(applies: bool, layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Row for a setting, greyed out where it is not used."""
    row = layout.row()
    row.enabled = applies
    return row


def facts(layout: bpy.types.UILayout, pairs: list[tuple[str, str]], factor: float = 0.4) -> None:
    """Draw names left and values right; the names take ``factor`` of the width."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    for name, value in pairs:
        split = column.split(factor=factor)
        left = split.row()
        left.alignment = "RIGHT"
        left.label(text=name)
        split.label(text=value)


def sentence(layout: bpy.types.UILayout, text: str, icon: str, context: bpy.types.Context,
             width: int | None = None) -> None:
    """Draw a text, broken into lines that fit ``width`` units of the interface, by default the sidebar."""
    # Without a window the interface has no scale.
    scale = context.preferences.system.ui_scale or 1.0
    pixels = width * scale if width else context.region.width if context.region else 300
    letters = max(20, int(pixels / (scale * PIXELS_PER_LETTER)) - 6)
    column = layout.column(align=True)
    column.scale_y = 0.75
    for number, line in enumerate(textwrap.wrap(for_panel(text), letters)):
        column.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"))
